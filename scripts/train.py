"""`haustra train`: learn to drive a scope, or another device."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class Train:
    """Train a policy; leave checkpoints, the learning curve and the policy in a folder.

    Options that are not given are as the training in --config has them.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for checkpoints, learning curve and policy."""
    config: str = "insertion-ppo"
    """A shipped training (insertion, insertion-ppo, insertion-cpu, insertion-gpu, insertion-depth, insertion-colour,
    insertion-sb3, insertion-easy, insertion-sac, for-a-design, inchworm, quick, tracked, withdrawal), or a JSON file
    like the training.json that a training leaves."""
    steps: int | None = whole(1, 10**12, default=None)
    """Length of the training in environment steps, counted over all worlds."""
    worlds: int | None = whole(1, 1_000_000, default=None)
    """Number of scopes that are stepped at once."""
    seed: int | None = whole(0, 2**32 - 1, default=None)
    """Seed of all random draws."""
    start: str | None = None
    """Policy to begin as, where the training's learner is 'device': a shipped one's name, or a folder."""
    imitate: int | None = whole(0, 10**12, default=None)
    """Number of steps in which the policy first learns from the lumen follower; 0 for none."""
    from_demonstrations: Path | None = None
    """Folder of recordings that the policy first learns from, instead of --imitate: `haustra record --task` or
    `haustra drive --task` makes them, by a hand or any driver."""
    design: str | None = None
    """Name of a scope design."""
    difficulty: Literal["any", "easy", "moderate", "difficult", "hard"] | None = None
    """Band of tortuosity that colons are grown from."""
    mesentery: bool | None = None
    """Let colons move on their mesentery."""
    colons: int | None = whole(1, 100_000, default=None)
    """Number of grown colons to train in, from seed 0 on."""
    backend: Literal["native", "linear", "linear-gpu", "warp"] | None = None
    """What computes the physics: MuJoCo on threads (native), the linear-time model on threads (linear) or on an NVIDIA
    GPU (linear-gpu), or MuJoCo Warp on one (warp)."""
    device: Literal["cpu", "cuda"] | None = None
    """Where the networks are computed: processor, or PyTorch's GPU."""
    threads: int = whole(1, 4096, default=2)
    """Number of threads for physics on the CPU."""
    processes: int = whole(1, 4096, default=2)
    """Number of processes that grow those colons which are not in the cache."""
    minutes: float | None = number("min", 0.01, 1e6, default=None)
    """Time after which training stops cleanly [min]; --resume goes on."""
    resume: bool = False
    """Go on from the folder's last checkpoint, up to --steps."""
    tensorboard: bool = False
    """Write logs for TensorBoard into the folder."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Train."""
        from haustra.scripts.console import progress_bar
        from haustra.scripts.learning_extra import require_learning

        training = self._training()
        require_learning("torch", *(("stable_baselines3",) if training.learner == "sb3" else ()))
        from haustra.envs.learning.settings import changed
        from haustra.envs.learning.train import train
        from haustra.errors import InvalidOptionError

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
            start=self.start,
            imitate=0 if self.from_demonstrations is not None else self.imitate,
            demonstrations=None if self.from_demonstrations is None else str(self.from_demonstrations),
        )
        if self.from_demonstrations is not None and self.imitate:
            raise InvalidOptionError("A policy first learns from --from-demonstrations or by --imitate: give one.")
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
