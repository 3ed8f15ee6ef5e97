"""The picture in docs/crosscheck.md: `python -m benchmarks.crosscheck.picture` regenerates it.

It runs the crosscheck of the flexible space robot, and the rerun viewer takes a picture of its file without a
screen; that needs a Vulkan driver, if only in software (Debian: mesa-vulkan-drivers). A few minutes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import sleep

from PIL import Image
from rerun.experimental import ViewerClient

from missing_physics.cli.commands.crosscheck import plan_of
from missing_physics.cli.progress import steps
from missing_physics.reporting.crosscheck import compare, write_crosscheck
from robot_model import load_robot

__all__ = ["main", "photograph"]

ROBOT = "flexible_space_robot"
#: Simulated duration, and the instant shown [s]: link 2 is accelerating then.
DURATION, SHOWN = 6.0, 4.0
TARGET = Path(__file__).parents[2] / "docs" / "crosscheck.png"
WIDTH, HEIGHT = 1400, 900
#: The viewer's own bars above and below [px], which are cropped.
BARS = (37, 31)
#: Colours of the picture: enough for the viewer's few hues, with a third of the bytes.
COLOURS = 128
PORT = 9911
#: Time after which the viewer has loaded and closed its welcome screen [s], also on a slow machine.
SETTLED = 25.0


def main() -> None:
    """Run both engines, write the rerun file, take the picture."""
    plan = plan_of(load_robot(ROBOT), duration=DURATION)
    with steps(quiet=False) as reporter:
        ours, theirs = plan.reference(reporter), plan.exudyn(reporter)
        comparison = compare(plan.robot, ours, theirs, plan.coarser(reporter, ours, theirs))
    with TemporaryDirectory() as folder:
        write_crosscheck(plan.robot, comparison, Path(folder) / "comparison.rrd")
        photograph(Path(folder) / "comparison.rrd", TARGET, at=SHOWN)
    print(f"{TARGET}: {TARGET.stat().st_size / 1000:.0f} kB")


def photograph(file: Path, target: Path, *, at: float) -> None:
    """A picture of a rerun file at an instant [s], as PNG."""
    viewer = [sys.executable, "-m", "rerun", "--headless", "--bind", "127.0.0.1", "--port", str(PORT)]
    size = ["--window-size", f"{WIDTH}x{HEIGHT}"]
    # `python -m rerun` starts the viewer as a child process, which must end with it.
    started = {"stderr": subprocess.DEVNULL, "start_new_session": True}
    with subprocess.Popen([*viewer, *size, str(file)], **started) as process:
        try:
            sleep(SETTLED)
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{PORT}/proxy")
            client.set_time("sim_time", duration=at)
            sleep(1.0)
            client.save_screenshot(str(target.resolve()))
        finally:
            os.killpg(process.pid, signal.SIGTERM)
    with Image.open(target) as picture:
        whole = picture.convert("RGB").resize((WIDTH, HEIGHT))
        small = whole.crop((0, BARS[0], WIDTH, HEIGHT - BARS[1])).quantize(COLOURS)
    small.save(target, optimize=True)


if __name__ == "__main__":
    main()
