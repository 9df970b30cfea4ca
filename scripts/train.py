"""`haustra train`: learn to drive a scope."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class Train:
    """Train a policy with Stable-Baselines3; leave checkpoints, the learning curve and the policy in a folder."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the run."""
    config: str = "insertion-ppo"
    """A shipped training: insertion-ppo, insertion-gpu, insertion-mesentery,
    insertion-easy, insertion-sac, quick; or a JSON file like a training.json."""
    steps: int | None = whole(1, 10**12, default=None)
    """Environment steps over all worlds."""
    worlds: int | None = whole(1, 1_000_000, default=None)
    """Scopes stepped at once."""
    seed: int | None = whole(0, 2**32 - 1, default=None)
    """Seed of all random draws."""
    imitate: int | None = whole(0, 10**12, default=None)
    """Steps in which the policy first learns from the lumen follower; 0 for none."""
    design: str | None = None
    """Scope design."""
    difficulty: Literal["any", "easy", "moderate", "difficult", "hard"] | None = None
    """Band of tortuosity that colons are grown from."""
    mesentery: bool | None = None
    """Let colons move on their mesentery."""
    colons: int | None = whole(1, 100_000, default=None)
    """Number of grown colons (seeds 0, 1, ...)."""
    backend: Literal["native", "linear", "linear-gpu", "warp"] | None = None
    """What computes the physics: MuJoCo on threads (native), the linear-time model on threads (linear) or on an NVIDIA
    GPU (linear-gpu), or MuJoCo Warp on one (warp)."""
    device: Literal["cpu", "cuda"] | None = None
    """Where the networks are computed: processor, or PyTorch's GPU."""
    threads: int = whole(1, 4096, default=2)
    """For physics on the CPU."""
    processes: int = whole(1, 4096, default=2)
    """Number of processes that grow those colons which are not in the cache."""
    minutes: float | None = number("min", 0.01, 1e6, default=None)
    """Stop cleanly after this time; --resume goes on."""
    resume: bool = False
    """Go on from the folder's last checkpoint, up to --steps."""
    tensorboard: bool = False
    """Write TensorBoard's logs into the folder."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Train."""
        from haustra.scripts.console import progress_bar
        from haustra.scripts.learning_extra import require_learning

        require_learning()
        from haustra.envs.learning.settings import changed
        from haustra.envs.learning.train import train

        training = self._training()
        task = training.task
        if self.colons is not None:
            task = replace(task, seeds=(0, self.colons))
        task = replace(
            task,
            **{
                name: value
                for name in ("design", "difficulty", "mesentery")
                if (value := getattr(self, name)) is not None
            },
        )
        training = changed(
            training,
            task=task,
            steps=self.steps,
            worlds=self.worlds,
            backend=self.backend,
            device=self.device,
            seed=self.seed,
            imitate=self.imitate,
        )
        with progress_bar("train", training.steps, unit="steps") as advance:
            return train(
                training,
                self.output,
                resume=self.resume,
                threads=self.threads,
                processes=self.processes,
                minutes=self.minutes,
                tensorboard=self.tensorboard,
                progress=lambda done, note: advance(done, note),
            )

    def _training(self) -> Any:
        from haustra.envs.learning.settings import Training, shipped
        from haustra.reading import read_document

        if not self.config.endswith(".json"):
            return shipped(self.config)
        return Training.from_json(read_document(Path(self.config), "training"))
