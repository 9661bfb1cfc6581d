"""Measure the acceptance rows of marker sensing and of the overlay, and write them as Markdown.

Usage: ``python bench/sensing_report.py [--quick] [--out bench/reports/sensing.md]``

All pictures are rendered: no camera, print or water was there. Times are processor time of this process alone.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import overlay_frames
import rendered_scenes
import sensing_rows
import sensing_series
from acceptance import Report


def main() -> None:
    """Run everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of every count")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "reports" / "sensing.md")
    options = parser.parse_args()
    part = 10 if options.quick else 1
    cv2.setNumThreads(1)
    report = Report("Marker sensing and overlay, on rendered pictures", "python bench/sensing_report.py")
    report.note("Pictures", PICTURES)
    sensing_rows.algebra(report)
    sensing_rows.exactness(report, 1000 // part)
    sensing_rows.simulated_sensor(report, 300 // part)
    sensing_rows.statistics(report)
    sensing_rows.simulated_accuracy(report)
    sensing_series.precision(report, 100 // part)
    sensing_series.gripper(report, 30 // part)
    sensing_series.accuracy(report, 30 // part)
    sensing_series.safe_range(report, 10 // part)
    sensing_rows.jitter(report, 200 // part)
    sensing_rows.end_to_end(report, 50 // part)
    rendered_scenes.rendered_scenes(report, max(12 // part, 1))
    overlay_frames.silhouettes(report, max(8 // part, 1))
    overlay_frames.frame_times(report, 60 // part)
    options.out.write_text(report.markdown(), encoding="utf-8")
    print(report.markdown())


PICTURES = (
    "The published camera (640 x 480, its matrix, skew left out) with the distortion of a usual web camera; one 4x4 "
    "marker of 80 mm. Every photosite is the mean of 64 rays. Plain: noise of 1 % of full scale, a spot of 0.6 "
    "pixels. Hard: a spot of 1 pixel, light falling off by 40 % across the picture, flicker of 2 %, JPEG of quality 85 "
    "as well. With noise of 1 % corners that are refined one by one scatter as the published ones do, so that is the "
    "fair noise to compare with."
)


if __name__ == "__main__":
    main()
