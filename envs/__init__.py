"""How a scene runs: backends, measures, environments.

Importing this registers the Gymnasium ids Haustra/Colonoscopy-v0, Haustra/Withdrawal-v0
and Haustra/Device-v0, where Gymnasium is installed (extra `rl`).
"""

from importlib.util import find_spec

if find_spec("gymnasium"):
    from haustra.envs.tasks.registration import register_environments

    register_environments()
