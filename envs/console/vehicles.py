"""Vehicles from what a recording holds of them: a colon's folder and JSON values."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.envs.console.vehicle import Surroundings, Vehicle
from haustra.errors import HaustraError, InvalidDesignError, UnreadableFileError
from haustra.models.anatomy.store import load_colon


def make_vehicle(folder: Path, configuration: Mapping[str, Any]) -> Vehicle:
    """The vehicle of that configuration (`Vehicle.configuration`) in the colon of a folder.

    Raises:
        UnreadableFileError: when there is no such kind of vehicle, or its values are not what it needs.
        HaustraError: when colon or design cannot be honoured.
    """
    return _made(folder, configuration, whole=True)


def surroundings(folder: Path, configuration: Mapping[str, Any]) -> Surroundings:
    """What is to be known of such a vehicle to draw it, without one that could be driven.

    Raises:
        UnreadableFileError: as `make_vehicle`.
        HaustraError: likewise.
    """
    return _made(folder, configuration, whole=False)


def _made(folder: Path, configuration: Mapping[str, Any], *, whole: bool) -> Any:
    values = dict(configuration)
    kind = values.pop("kind", None)
    makers = {"scope": _scope, "device": _device, "episode": _episode}
    if kind not in makers:
        raise UnreadableFileError(f"Vehicle kind '{kind}' is not known. Known: {', '.join(makers)}.")
    try:
        return makers[kind](folder, values, whole)
    except HaustraError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableFileError(f"The vehicle is incomplete ({type(error).__name__}: {error}).") from error


def _scope(folder: Path, values: Mapping[str, Any], whole: bool) -> Any:
    from haustra.envs.console.scope_vehicle import ScopeVehicle, scope_surroundings
    from haustra.fields import read_fields
    from haustra.models.devices.scope.design import ScopeDesign
    from haustra.models.scene import SceneOptions

    design = read_fields(ScopeDesign, dict(values["design"]), "design", error=InvalidDesignError)
    options = read_fields(SceneOptions, dict(values["options"]), "options")
    if not whole:
        return scope_surroundings(load_colon(folder), design, options)
    return ScopeVehicle(load_colon(folder), design, options, driver=str(values["driver"]))


def _device(folder: Path, values: Mapping[str, Any], whole: bool) -> Any:
    from haustra.envs.console.device_vehicle import DeviceVehicle, device_surroundings
    from haustra.models.device_scene import build_device_scene, device_options, pose_in
    from haustra.models.devices.base import device_class, kinds

    table, changed, colon = dict(values["device"]), dict(values["options"]), load_colon(folder)
    if (kind := table.pop("kind")) not in kinds():
        raise UnreadableFileError(f"Device kind '{kind}' is not known. Known: {', '.join(kinds())}.")
    device = device_class(kind).from_toml(table, "the vehicle's device")
    if whole:
        return DeviceVehicle(colon, device, changed)
    options = device_options(device, **changed)
    return device_surroundings(colon, build_device_scene(device, options, pose=pose_in(colon, device, options)))


def _episode(folder: Path, values: Mapping[str, Any], whole: bool) -> Any:
    from haustra.envs.console.episode_vehicle import EpisodeVehicle, episode_surroundings
    from haustra.envs.tasks.bank import folder_bank
    from haustra.envs.tasks.config import TaskConfig
    from haustra.models.devices.scope.library import named_design

    config = TaskConfig.from_json(dict(values["task"]))
    if whole:
        return EpisodeVehicle(folder, config, seed=int(values["seed"]), policy=str(values["policy"]))
    return episode_surroundings(folder_bank([folder], named_design(config.design)).with_mesentery(config.mesentery))
