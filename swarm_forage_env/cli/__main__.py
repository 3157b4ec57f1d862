"""`python -m swarm_forage_env.cli` is `swarm-forage`."""

from swarm_forage_env.cli import main

if __name__ == "__main__":  # worker processes import this module too
    main()
