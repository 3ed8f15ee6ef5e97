"""The picture in docs/crosscheck.md: `python -m benchmarks.crosscheck_picture` makes it anew.

It runs the crosscheck of the flexible space robot, and the rerun viewer takes a picture of its file without a
screen; that needs a Vulkan driver, if only in software (Debian: mesa-vulkan-drivers). A few minutes.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from missing_physics.cli.crosscheck import plan_of
from missing_physics.cli.progress import steps
from missing_physics.reporting.crosscheck import compare, write_crosscheck
from robot_model import load_robot

__all__ = ["main"]

ROBOT = "flexible_space_robot"
#: Seconds of the motion: link 2 is bent most while it is accelerated and braked.
DURATION = 6.0
STEP = 1e-3
TARGET = Path(__file__).parents[1] / "docs" / "crosscheck.png"
WIDTH, HEIGHT = 1400, 900
#: Of the picture: enough for a screen of few hues, in a third of the bytes.
COLOURS = 128


def main() -> None:
    """Run both engines, write the rerun file, take the picture."""
    plan = plan_of(load_robot(ROBOT), duration=DURATION, step=STEP)
    with steps(quiet=False) as told:
        ours, theirs = plan.reference(told), plan.exudyn(told)
        comparison = compare(plan.robot, ours, theirs, plan.coarser(told, ours, theirs))
    with TemporaryDirectory() as folder:
        file, shot = Path(folder) / "comparison.rrd", Path(folder) / "shot.png"
        write_crosscheck(plan.robot, comparison, file, at_end=True)
        viewer = [
            sys.executable,
            "-m",
            "rerun",
            "--headless",
            "--bind",
            "127.0.0.1",
            "--port",
            "auto",
            str(file),
        ]
        size = ["--window-size", f"{WIDTH}x{HEIGHT}"]
        subprocess.run([*viewer, "--screenshot-to", str(shot), *size], check=True)
        with Image.open(shot) as picture:
            picture.convert("RGB").quantize(COLOURS).save(TARGET, optimize=True)
    print(f"{TARGET}: {TARGET.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
