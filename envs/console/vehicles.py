"""Vehicles from what a recording holds of them: a colon's folder and JSON values."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.envs.console.vehicle import Vehicle
from haustra.errors import HaustraError, UnreadableFileError


def make_vehicle(folder: Path, configuration: Mapping[str, Any]) -> Vehicle:
    """The vehicle of that configuration (`Vehicle.configuration`) in the colon of a folder.

    Raises:
        UnreadableFileError: when there is no such kind of vehicle, or its values are not what it needs.
        HaustraError: when colon or design cannot be honoured.
    """
    from haustra.models.anatomy.store import load_colon

    values = dict(configuration)
    kind = values.pop("kind", None)
    try:
        match kind:
            case "scope":
                from haustra.envs.console.scope_vehicle import ScopeVehicle, options_from
                from haustra.errors import InvalidDesignError
                from haustra.fields import read_fields
                from haustra.models.devices.scope.design import ScopeDesign

                design = read_fields(ScopeDesign, dict(values["design"]), "design", error=InvalidDesignError)
                return ScopeVehicle(load_colon(folder), design, options_from(values["options"]))
            case "device":
                from haustra.envs.console.device_vehicle import DeviceVehicle
                from haustra.models.devices.base import device_class, kinds

                table = dict(values["device"])
                if (of := table.pop("kind")) not in kinds():
                    raise UnreadableFileError(f"Device kind '{of}' is not known. Known: {', '.join(kinds())}.")
                device = device_class(of).from_toml(table, "the recording's device")
                return DeviceVehicle(load_colon(folder), device, dict(values["options"]))
            case "episode":
                from haustra.envs.console.episode_vehicle import EpisodeVehicle
                from haustra.envs.tasks.config import TaskConfig

                task = TaskConfig.from_json(dict(values["task"]))
                return EpisodeVehicle(folder, task, seed=int(values["seed"]), policy=str(values["policy"]))
    except HaustraError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableFileError(f"The recording's vehicle is incomplete ({type(error).__name__}: {error}).") from error
    raise UnreadableFileError(f"Vehicle kind '{kind}' is not known. Known: scope, device, episode.")
