"""The command `saliency`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env._internal.wording import printable
from swarm_forage_env.cli.option_groups import PolicyOptions, WorldOptions
from swarm_forage_env.cli.options import AsJson, Picture, Seed, no_picture
from swarm_forage_env.cli.terminal import notes


def saliency(
    policies: PolicyOptions,
    described: WorldOptions,
    picture: Picture = None,
    seconds: Annotated[float | None, typer.Option(help="Simulated seconds to look at; default the whole run.")] = None,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Show what a trained network looks at: how much it acts otherwise when one part of what it sees is exchanged.

    A robot gets, for example, the light readings of another robot. How often does it then decide otherwise? The policy
    is a shipped network, or an .npz file of a training.
    """
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.inspect.saliency import open_network_of
    from swarm_forage_env.inspect.saliency import saliency as measured
    from swarm_forage_env.rendering.figures import check_picture

    policy = policies.one()
    network = open_network_of(policy)
    (spec,) = plan_runs(described, (policy,), n_seeds=1, first_seed=seed)
    file = picture or Path("results", f"{spec.scenario.name}_{Path(policy).stem}.saliency.png")
    check_picture(file)
    found = measured(network, spec, seconds=seconds)
    typer.echo(found.json() if as_json else printable(found.text()))
    try:
        found.draw(file)
    except ImportError as error:
        notes().print(str(error))
        return
    except OSError as error:  # the table is worth more than its picture
        notes().print(no_picture(file, error))
        return
    notes().print(f"picture {file}")
