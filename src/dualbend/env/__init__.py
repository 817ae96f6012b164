"""Environments for learning: Gymnasium's, and PettingZoo's with an arm an agent.

``gymnasium.make("dualbend.env:dualbend/Bend-v1")`` imports this package, which registers them.
"""

from dualbend.errors import InputError

EXTRA = "the environments need gymnasium and pettingzoo: pip install 'dualbend[env]'"

try:
    import gymnasium
except ImportError as error:
    raise InputError(EXTRA) from error

gymnasium.register(
    "dualbend/Bend-v1",
    entry_point="dualbend.env.bend:BendEnv",
    vector_entry_point="dualbend.env.worlds:BendWorlds",
)
gymnasium.register("dualbend/Assemble-v1", entry_point="dualbend.env.assemble:AssembleEnv")
