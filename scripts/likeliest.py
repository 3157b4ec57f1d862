#!/usr/bin/env python
"""Write a trained network once more, so that it takes its likeliest action where it drew its actions before.

python scripts/likeliest.py generalist likeliest.npz
swarm-forage run --scenario search_and_rescue --robots 64 --policy generalist,likeliest.npz --seeds 4

The weights are the same, so that the two rows tell what drawing is worth.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file


def main() -> None:
    """Read one file, write the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", help="name of a shipped network, or its file")
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    drawing = Network.load(network_file(arguments.policy) or arguments.policy)
    replace(drawing, about=replace(drawing.about, samples=False)).save(arguments.out)


if __name__ == "__main__":
    main()
