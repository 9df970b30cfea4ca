"""Many test rigs of the tracked robot at once on an NVIDIA GPU, by MuJoCo Warp.

Worlds may be of several designs, as long as their rigs have the same parts; tread speed and friction are each world's
own. Forces are read on the device as the rigs run, so only means and amplitudes travel. Without a GPU the same
kernels run on the CPU, slowly: for tests.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import warp as wp
from jaxtyping import Bool, Complex, Float, Int
from mujoco.mjx.third_party import mujoco_warp

from haustra.envs.runs.measure.propulsion import READ, SETTLING, TOUCHING
from haustra.envs.runs.warp_kernels import HARMONICS, MEANS, SUMS, WAVES, count_step, read_forces, steer
from haustra.envs.sim.warp_setup import use_warp
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.devices.tracked.rig import STRING_LENGTH, STRING_STIFFNESS, Rig

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
    waves: Complex[np.ndarray, "worlds harmonics"]
    """Amplitudes and phases of what pulls, string or friction, at the first step that is read: it is its mean and the
    real part of the sum of waves times exp(2 pi i n t / T) [N]."""
    roll: Float[np.ndarray, " worlds"]
    """Mean roll rate of a free core about its axis [rad/s]; 0 on a fixed one."""
    touching: Float[np.ndarray, " worlds"]
    """Share of the time for which the pad that lifts most touches the wall."""
    steps: int
    """Time steps of each world."""


class WarpRigs:
    """State of one rig, or of several that differ in their numbers only."""

    def __init__(self, rigs: Sequence[Rig], *, which: Int[np.ndarray, " worlds"], device: str | None = None) -> None:
        """Put the worlds on a device; kernels compile with the first steps, for a minute or more, and are then kept.

        Args:
            rigs: From `flat_rig` or `tube_rig`.
            which: Number of each world's rig.
            device: As Warp names them, 'cuda:0' or 'cpu'; its own choice when None.

        Raises:
            InvalidOptionError: when there are no worlds, or rigs that a batch cannot share.
            UnsupportedSceneError: when MuJoCo Warp cannot honour a rig; it says what.
        """
        if not len(rigs) or not len(which):
            raise InvalidOptionError(f"{len(rigs)} rigs in {len(which)} worlds: give at least 1 of each.")
        self.rigs, self.which, self.worlds = tuple(rigs), np.asarray(which), len(which)
        use_warp()
        rig, models = rigs[0], [_model(each) for each in rigs]
        self.model = models[0]
        self._device = wp.get_device(device)
        whole = bool(rig.string)
        with wp.ScopedDevice(self._device):
            try:
                self._warp = mujoco_warp.put_model(self.model)
            except NotImplementedError as error:
                raise UnsupportedSceneError(f"The backend 'warp' cannot honour this rig: {error}") from error
            self._warp.opt.warn_overflow = 0  # overflows are counted here, not printed at every step
            self._give_each_its_own(models)
            self._rows = _ROWS[whole]
            self._data = mujoco_warp.put_data(
                self.model, mujoco.MjData(self.model), nworld=self.worlds, nconmax=_CONTACTS[whole], njmax=self._rows
            )
            self._place_what_stands(models)
            tables = [
                each.tracked.phase_controls(np.linspace(0.0, each.tracked.design.tread.pitch, _PHASES + 1))
                for each in rigs
            ]
            self._table, self._which = wp.array(np.array(tables, np.float32), dtype=float), wp.array(which, dtype=int)
            pads = rig.tracked.pads
            self._columns = wp.array([self.model.actuator(pad.actuator).id for pad in pads], dtype=int)
            self._sensors = wp.array([self.model.sensor(pad.contact).adr[0] for pad in pads], dtype=int)
        self._string = int(self.model.sensor(rig.string).adr[0]) if whole else -1

    def _place_what_stands(self, models: Sequence[mujoco.MjModel]) -> None:
        """Geoms that cannot move where each world's rig has them: Warp reads their places from its data once."""
        placed = [mujoco.MjData(model) for model in models]
        for model, data in zip(models, placed, strict=True):
            mujoco.mj_kinematics(model, data)
        for name in ("geom_xpos", "geom_xmat"):
            kept: Any = getattr(self._data, name)
            each = np.array([getattr(data, name) for data in placed], np.float32)
            rows = each[self.which].reshape(self.worlds, *kept.numpy().shape[1:])
            setattr(self._data, name, wp.array(rows, dtype=kept.dtype))

    def _give_each_its_own(self, models: Sequence[mujoco.MjModel]) -> None:
        """Every array in which the models differ, a row for each world."""
        for name in _differing(models):
            if not hasattr(self._warp, name):
                continue  # Warp does not read it
            shared: Any = getattr(self._warp, name)
            if not isinstance(shared, wp.array) or shared.shape[0] != 1:
                raise UnsupportedSceneError(f"The backend 'warp' cannot vary '{name}' from world to world.")
            each = np.array([np.asarray(getattr(model, name)) for model in models], np.float32)
            rows = each[self.which].reshape(self.worlds, *shared.numpy().shape[1:])
            setattr(self._warp, name, wp.array(rows, dtype=shared.dtype))

    def pull(
        self,
        speeds: Float[np.ndarray, " worlds"],
        friction: Float[np.ndarray, " worlds"],
        *,
        roll_torque: Float[np.ndarray, " worlds"] | None = None,
    ) -> Pulls:
        """Run the treads at steady speeds and read a second or more of whole tooth passages, after settling.

        Args:
            speeds: Of the treads relative to the core, positive [m/s].
            friction: Coulomb's coefficient of the treads.
            roll_torque: of the flexible shaft on a free core about its axis [N m]; none when None.

        Raises:
            InvalidOptionError: when a torque is asked of a fixed core, or a speed or friction cannot be honoured.
        """
        _require(speeds, friction, self.worlds)
        if roll_torque is not None and not (self._string >= 0 and np.isfinite(roll_torque).all()):
            raise InvalidOptionError("Only a core that is free can be turned, and by a finite torque.")
        step = float(self.model.opt.timestep)
        frequency = speeds / np.array([rig.tracked.design.tread.pitch for rig in self.rigs])[self.which]
        read = np.round(np.ceil(READ * frequency) / frequency / step).astype(np.int32)
        settling = round(SETTLING / step)
        steps = -(-(settling + int(read.max())) // _STEPS) * _STEPS
        with wp.ScopedDevice(self._device):
            self._set(speeds, friction, roll_torque)
            sums = wp.zeros((self.worlds, SUMS), dtype=float)
            pads = (self.worlds, len(self.rigs[0].tracked.pads))
            touching = wp.zeros(pads, dtype=float)
            broken = wp.zeros(self.worlds, dtype=int)
            now, passing = wp.zeros(1, dtype=int), wp.array(frequency, dtype=float)
            window = wp.array(np.stack([np.full_like(read, settling), settling + read], axis=1), dtype=wp.vec2i)

            def one() -> None:
                data, time = self._data, (now, step, passing)
                wp.launch(steer, pads, inputs=[*time, self._which, self._table, self._columns], outputs=[data.ctrl])
                mujoco_warp.step(self._warp, data)
                seen = [data.sensordata, data.qvel, self._sensors, self._string, STRING_STIFFNESS, STRING_LENGTH]
                limits = [data.nefc, self._rows, data.nacon, data.naconmax]
                wp.launch(
                    read_forces, self.worlds, inputs=[*time, window, *seen, *limits], outputs=[sums, touching, broken]
                )
                wp.launch(count_step, 1, inputs=[now])

            self._repeat(one, steps)
            parts = [part.numpy() for part in (sums, touching, broken)]
        return self._pulls(*parts, begin=settling * step * frequency, steps=steps)

    def _set(self, speeds: np.ndarray, friction: np.ndarray, roll_torque: np.ndarray | None) -> None:
        """Back to the start, every world with its own treads and torque."""
        mujoco_warp.reset_data(self._warp, self._data)
        if roll_torque is not None:
            control = np.zeros((self.worlds, self.model.nu), np.float32)
            control[:, self.model.actuator(self.rigs[0].tracked.roll_motor).id] = roll_torque
            self._data.ctrl.assign(control)
        surface = np.repeat(self.model.geom_surfacevel[None].astype(np.float32), self.worlds, axis=0)
        coefficients = np.repeat(self.model.geom_friction[None].astype(np.float32), self.worlds, axis=0)
        for pad in self.rigs[0].tracked.pads:
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

    def _pulls(
        self, sums: np.ndarray, touching: np.ndarray, broken: np.ndarray, *, begin: np.ndarray, steps: int
    ) -> Pulls:
        read = np.maximum(sums[:, :1].astype(float), 1.0)
        whole = self._string >= 0
        normal, force, string, roll = (sums[:, 1:MEANS].astype(float) / read).T
        parts = sums[:, MEANS:].astype(float).reshape(-1, HARMONICS, WAVES) / read[..., None]
        pulling, tension = (
            2
            * (
                parts[..., at]
                - mean[:, None] * parts[..., 4]
                - 1j * (parts[..., at + 1] - mean[:, None] * parts[..., 5])
            )
            for at, mean in ((0, force), (2, string))
        )
        # Phases were counted from the start; `begin` teeth had passed when reading began.
        turned = np.exp(2j * np.pi * begin[:, None] * np.arange(1, HARMONICS + 1))
        touched = (touching / read).min(axis=1)
        sound = (broken == 0) & np.isfinite(sums).all(axis=1) & (touched >= TOUCHING)
        blank = np.where(sound, 1.0, np.nan)
        return Pulls(
            sound=sound,
            force=force * blank,
            normal=normal * blank,
            string=(string if whole else force) * blank,
            ripple=np.abs(pulling) * blank[:, None],
            waves=(tension if whole else pulling) * turned * blank[:, None],
            roll=roll * blank,
            touching=touched,
            steps=steps,
        )


def _model(rig: Rig) -> mujoco.MjModel:
    """The rig's model. Warp does not reset what diverges, so it knows no flag that says not to."""
    spec = rig.spec.copy()
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return spec.compile()


def _differing(models: Sequence[mujoco.MjModel]) -> list[str]:
    """Names of arrays that are not the same in all models, but for friction and tread speed, which are set anyway.

    Raises:
        InvalidOptionError: when their parts are not the same.
    """
    first, names = models[0], []
    for name in sorted(set(dir(first)) - {"geom_friction", "geom_surfacevel"}):
        value = getattr(first, name) if not name.startswith("_") else None
        if not isinstance(value, np.ndarray):
            continue
        others = [np.asarray(getattr(model, name)) for model in models[1:]]
        if any(other.shape != value.shape for other in others):
            raise InvalidOptionError(f"Rigs that share a batch must have the same parts; '{name}' differs in size.")
        if not all(np.array_equal(value, other) for other in others):
            if value.dtype.kind != "f":
                raise InvalidOptionError(f"Rigs that share a batch must have the same parts; '{name}' differs.")
            names.append(name)
    return names


def _require(speeds: np.ndarray, friction: np.ndarray, worlds: int) -> None:
    if speeds.shape != (worlds,) or friction.shape != (worlds,):
        raise InvalidOptionError(f"Give a speed and a friction for each of the {worlds} worlds.")
    if not (np.isfinite(speeds).all() and (speeds > 0).all() and (speeds < 1).all()):
        raise InvalidOptionError("Tread speeds must be positive and below 1 m/s.")
    if not ((friction >= 0) & (friction <= 2)).all():
        raise InvalidOptionError("Tread friction must be a coefficient from 0 to 2.")
