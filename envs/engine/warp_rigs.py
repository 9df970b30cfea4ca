"""Many test rigs of the tracked robot at once on an NVIDIA GPU, by MuJoCo Warp.

Rigs share geometry; tread speed and friction are each world's own. Forces are read on the device as the rigs run, so
only means and amplitudes travel. Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import warp as wp
from jaxtyping import Bool, Float
from mujoco.mjx.third_party import mujoco_warp

from haustra.envs.engine.warp_kernels import HARMONICS, SUMS, count_step, read_forces, steer
from haustra.envs.measure.propulsion import READ, SETTLING, TOUCHING
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.tracked.rig import STRING_LENGTH, STRING_STIFFNESS, Rig

_PHASES = 2048
"""Tooth phases at which controls are tabulated; between them they are linear, 1e-6 of their range off."""
_CONTACTS, _ROWS = {False: 4, True: 32}, {False: 16, True: 96}
"""Contacts and constraint rows kept for each world, of one track and of a whole device; more is an overflow, which ends
as outcome. A ball over a seam of the tube stands on two staves."""
_STEPS = 50
"""Time steps in one CUDA graph."""


@dataclass(frozen=True)
class Pulls:
    """What many rigs pulled; arrays have one entry a world. Worlds that are not `sound` hold no figures, only NaN."""

    sound: Bool[np.ndarray, " worlds"]
    """False where a number was not finite, contacts overflowed, or a pad was off the wall for half the time."""
    force: Float[np.ndarray, " worlds"]
    """Mean propulsion: friction of all pads [N]."""
    normal: Float[np.ndarray, " worlds"]
    """Mean sum of all pads' normal forces [N]."""
    string: Float[np.ndarray, " worlds"]
    """Mean tension of the string [N]; the friction itself on a fixed core."""
    ripple: Float[np.ndarray, "worlds harmonics"]
    """Amplitudes of the propulsion force at the tooth-passing frequency and its multiples [N]."""
    steps: int
    """Time steps of each world."""


class WarpRigs:
    """Worlds of one rig."""

    def __init__(self, rig: Rig, *, worlds: int, device: str | None = None) -> None:
        """Put the worlds on a device; kernels compile with the first steps, for a minute or more, and are then kept.

        Args:
            rig: From `flat_rig` or `tube_rig`.
            worlds: How many.
            device: As Warp names them, 'cuda:0' or 'cpu'; its own choice when None.

        Raises:
            InvalidOptionError: when there are no worlds.
            UnsupportedSceneError: when MuJoCo Warp cannot honour the rig; it says what.
        """
        if worlds < 1:
            raise InvalidOptionError(f"worlds is {worlds}: give at least 1.")
        wp.config.quiet = True
        self.rig, self.worlds = rig, worlds
        self.model = _model(rig)
        self._device = wp.get_device(device)
        whole = bool(rig.string)
        with wp.ScopedDevice(self._device):
            try:
                self._warp = mujoco_warp.put_model(self.model)
            except NotImplementedError as error:
                raise UnsupportedSceneError(f"The engine 'mjx-warp' cannot honour this rig: {error}") from error
            self._warp.opt.warn_overflow = 0  # overflows are counted here, not printed at every step
            self._rows = _ROWS[whole]
            self._data = mujoco_warp.put_data(
                self.model, mujoco.MjData(self.model), nworld=worlds, nconmax=_CONTACTS[whole], njmax=self._rows
            )
            pads = rig.tracked.pads
            phases = np.linspace(0.0, rig.tracked.design.tread.pitch, _PHASES + 1)
            self._table = wp.array(rig.tracked.phase_controls(phases).astype(np.float32), dtype=float)
            self._columns = wp.array([self.model.actuator(pad.actuator).id for pad in pads], dtype=int)
            self._sensors = wp.array([self.model.sensor(pad.contact).adr[0] for pad in pads], dtype=int)
        self._string = int(self.model.sensor(rig.string).adr[0]) if whole else -1

    def pull(self, speeds: Float[np.ndarray, " worlds"], friction: Float[np.ndarray, " worlds"]) -> Pulls:
        """Run the treads at steady speeds and read a second or more of whole tooth passages, after settling.

        Args:
            speeds: Of the treads relative to the core, positive [m/s].
            friction: Coulomb's coefficient of the treads.

        Raises:
            InvalidOptionError: when a speed or friction cannot be honoured.
        """
        _require(speeds, friction, self.worlds)
        step, pitch = float(self.model.opt.timestep), self.rig.tracked.design.tread.pitch
        frequency = speeds / pitch
        read = np.round(np.ceil(READ * frequency) / frequency / step).astype(np.int32)
        settling = round(SETTLING / step)
        steps = -(-(settling + int(read.max())) // _STEPS) * _STEPS
        with wp.ScopedDevice(self._device):
            self._set(speeds, friction)
            sums = wp.zeros((self.worlds, SUMS), dtype=float)
            touching = wp.zeros((self.worlds, len(self.rig.tracked.pads)), dtype=float)
            broken = wp.zeros(self.worlds, dtype=int)
            now, speed = wp.zeros(1, dtype=int), wp.array(speeds, dtype=float)
            window = wp.array(np.stack([np.full_like(read, settling), settling + read], axis=1), dtype=wp.vec2i)

            def one() -> None:
                data, time = self._data, (now, float(step), float(pitch), speed)
                pads = (self.worlds, len(self.rig.tracked.pads))
                wp.launch(steer, pads, inputs=[*time, self._table, self._columns], outputs=[data.ctrl])
                mujoco_warp.step(self._warp, data)
                seen = [data.sensordata, self._sensors, self._string, STRING_STIFFNESS, STRING_LENGTH]
                limits = [data.nefc, self._rows, data.nacon, data.naconmax]
                wp.launch(
                    read_forces, self.worlds, inputs=[*time, window, *seen, *limits], outputs=[sums, touching, broken]
                )
                wp.launch(count_step, 1, inputs=[now])

            self._repeat(one, steps)
            parts = [part.numpy() for part in (sums, touching, broken)]
        return self._pulls(*parts, steps=steps)

    def _set(self, speeds: np.ndarray, friction: np.ndarray) -> None:
        """Back to the start, every world with its own treads."""
        mujoco_warp.reset_data(self._warp, self._data)
        surface = np.repeat(self.model.geom_surfacevel[None].astype(np.float32), self.worlds, axis=0)
        coefficients = np.repeat(self.model.geom_friction[None].astype(np.float32), self.worlds, axis=0)
        for pad in self.rig.tracked.pads:
            geom = self.model.geom(pad.geom).id
            surface[:, geom, 0], coefficients[:, geom, 0] = -speeds, friction
        self._warp.geom_surfacevel = wp.array(surface, dtype=self._warp.geom_surfacevel.dtype)
        self._warp.geom_friction = wp.array(coefficients, dtype=wp.vec3)
        self._warp.flg_surfacevel = True

    def _repeat(self, one: Callable[[], None], steps: int) -> None:
        """On a GPU as a graph: launching each kernel by itself would take longer than running it."""
        first = min(steps, 2)
        for _ in range(first if self._device.is_cuda else steps):
            one()  # what is not compiled yet compiles now
        if not self._device.is_cuda:
            return
        with wp.ScopedCapture() as capture:
            for _ in range(_STEPS):
                one()
        for _ in range(-(-(steps - first) // _STEPS)):
            wp.capture_launch(capture.graph)
        wp.synchronize_device()

    def _pulls(self, sums: np.ndarray, touching: np.ndarray, broken: np.ndarray, *, steps: int) -> Pulls:
        read = np.maximum(sums[:, :1].astype(float), 1.0)
        normal, force, string = (sums[:, 1:4].astype(float) / read).T
        waves = sums[:, 4:].astype(float).reshape(-1, HARMONICS, 4) / read[..., None]
        cosine = waves[..., 0] - force[:, None] * waves[..., 2]
        sine = waves[..., 1] - force[:, None] * waves[..., 3]
        sound = (broken == 0) & np.isfinite(sums).all(axis=1) & ((touching / read).min(axis=1) >= TOUCHING)
        blank = np.where(sound, 1.0, np.nan)
        return Pulls(
            sound=sound,
            force=force * blank,
            normal=normal * blank,
            string=(string if self._string >= 0 else force) * blank,
            ripple=2 * np.hypot(cosine, sine) * blank[:, None],
            steps=steps,
        )


def _model(rig: Rig) -> mujoco.MjModel:
    """The rig's model. Warp does not reset what diverges, so it knows no flag that says not to."""
    spec = rig.spec.copy()
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return spec.compile()


def _require(speeds: np.ndarray, friction: np.ndarray, worlds: int) -> None:
    if speeds.shape != (worlds,) or friction.shape != (worlds,):
        raise InvalidOptionError(f"Give a speed and a friction for each of the {worlds} worlds.")
    if not (np.isfinite(speeds).all() and (speeds > 0).all() and (speeds < 1).all()):
        raise InvalidOptionError("Tread speeds must be positive and below 1 m/s.")
    if not ((friction >= 0) & (friction <= 2)).all():
        raise InvalidOptionError("Tread friction must be a coefficient from 0 to 2.")
