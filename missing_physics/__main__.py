"""``python -m missing_physics``: the same command line as ``missing-physics``."""

from missing_physics.cli import main

if __name__ == "__main__":
    main()
