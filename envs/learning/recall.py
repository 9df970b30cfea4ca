"""What a policy keeps of the past by itself: its last action, and running means of what it saw and did."""

from typing import Any

from jaxtyping import Float

from haustra.envs.tasks.observation import forgetting, renewed


def recalled_width(seen: int, actions: int, times: int) -> int:
    """How many entries a policy reads that is shown so many, and keeps as many means; what it is shown without any."""
    return seen if times == 0 else (seen + actions) * (1 + times)


class Recall:
    """Memory of a policy at the wheel of many worlds, in arrays of numpy or tensors of torch."""

    def __init__(self, xp: Any, times: tuple[float, ...], interval: float) -> None:
        """Remember nothing yet.

        Args:
            xp: numpy or torch.
            times: within each of which a mean forgets by 1/e [s]; with none, what is seen is handed on.
            interval: between two looks [s].
        """
        self._xp, self._rates = xp, forgetting(times, interval)
        self._means: list[Any] = []

    def look(
        self,
        seen: Float[Any, "worlds seen"],
        action: Float[Any, "worlds actions"],
        begins: Float[Any, "worlds 1"],
    ) -> Float[Any, "worlds entries"]:
        """Take in what is seen now, and what the policy did last.

        Args:
            seen: what is shown now.
            action: the last one.
            begins: 1 in worlds that begin, where nothing before this look counts; 0 elsewhere.

        Returns:
            What is seen, the last action, and how both differ from each of their means.
        """
        if not self._rates:
            return seen
        now = self._xp.concatenate([seen, self._xp.clip(action, -1.0, 1.0) * (1.0 - begins)], axis=1)
        before = self._means or [now] * len(self._rates)
        self._means = [
            renewed(mean, rate + (1.0 - rate) * begins, now) for mean, rate in zip(before, self._rates, strict=True)
        ]
        return self._xp.concatenate([now, *(now - mean for mean in self._means)], axis=1)
