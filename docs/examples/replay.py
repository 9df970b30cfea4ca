"""Replay: a recorded drive is done again, to the bit, and drawn as a film.

`haustra drive` records a person's hand in the browser in the same way.
"""

from pathlib import Path

from PIL import Image

import haustra
from haustra.envs.console.film import write_film
from haustra.envs.console.recording import Recorder, load_recording
from haustra.envs.console.replay import repeat
from haustra.envs.console.scope_vehicle import ScopeVehicle
from haustra.envs.console.session import Session
from haustra.models.devices.scope.library import named_design

colon = haustra.grow_colon(seed=6)
options = haustra.SceneOptions(wall_law="table", mesentery=True)
vehicle = ScopeVehicle(colon, named_design("adult"), options)
session = Session(vehicle, Recorder(Path("drive"), vehicle, driver="follower"), assisted=True)
while session.time < 8.0 and session.tick():
    pass
session.end()

recording = load_recording(Path("drive"))
found = repeat(recording)
print(f"{found.steps} steps again, {'the same to the bit' if found.exact else f'not from {found.first_difference} on'}")
write_film(Path("drive.gif"), recording, fps=2.0)
with Image.open("drive.gif") as film:
    film.seek(film.n_frames - 1)
    film.convert("RGB").save("replay.webp")
