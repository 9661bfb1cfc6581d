"""Films a whole task on the pilot's page: a tool is taken, lifted, carried to its rack and put down.

Usage: ``PYTHONPATH=tests/helpers python -m rrtik_tests.pilot_film [--hands keyboard|gamepad] [--out FILE.gif]``
"""

import argparse
import base64
import io
import tempfile
from pathlib import Path

from PIL import Image

from rrtik_ompl.pilot.devices.simulated_vehicle import find_vehicle
from rrtik_ompl.pilot.setup import SessionOptions
from rrtik_tests.browser import Browser, Running
from rrtik_tests.pilot_hands import HANDS, pick_and_place

WIDTH, MILLISECONDS, COLORS = 800, 500, 128


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hands", choices=sorted(HANDS), default="keyboard")
    parser.add_argument("--out", type=Path, default=Path("pilot_task.gif"))
    options = parser.parse_args()
    pictures = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(folder)

        def look():
            data = base64.b64decode(browser.call("Page.captureScreenshot", format="png")["data"])
            whole = Image.open(io.BytesIO(data)).convert("RGB")
            pictures.append(whole.resize((WIDTH, WIDTH * whole.height // whole.width), Image.Resampling.LANCZOS))

        tool = Path(find_vehicle("titan4_sdu")).with_name("titan4_tool.yaml")
        try:
            with Running(SessionOptions("titan4_sdu", vehicle=tool, seed=1)) as running:
                pick_and_place(browser, running, HANDS[options.hands], look)
        finally:
            browser.close()
    few = [each.quantize(COLORS) for each in pictures]
    times = [MILLISECONDS] * (len(few) - 1) + [4 * MILLISECONDS]
    few[0].save(options.out, save_all=True, append_images=few[1:], duration=times, loop=0, optimize=True)
    print(f"wrote {options.out}: {len(few)} pictures")


if __name__ == "__main__":
    main()
