"""What workers of studies are started with."""

from haustra.envs.study.pool import surroundings


def test_workers_leave_gpus_to_those_who_step_worlds_there():
    """On a machine with a GPU each of 30 workers on cores took three quarters of its memory, and all but one died."""
    assert surroundings("linear", {"HOME": "/"})["JAX_PLATFORMS"] == "cpu"
    assert surroundings("linear-gpu", {"JAX_PLATFORMS": "cuda"})["JAX_PLATFORMS"] == "cuda", "a user's word stands"
    assert "JAX_PLATFORMS" not in surroundings("warp", {})
