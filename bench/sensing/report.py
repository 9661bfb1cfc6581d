"""Marker sensing and the overlay, on rendered pictures: range, jitter, grasps, rendered scenes, times of frames.

The published series are measured by ``rrtik reproduce sensing``.
All pictures are rendered: no camera, print or water was there. Times are processor time of one process alone, which is
why the last section is measured when the others are done.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import cv2
from typer import Option

from bench.sensing import overlay_frames, rendered_scenes, rows
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.page import Report

PICTURES = (
    "The published camera (640 x 480, its matrix, skew left out) with the distortion of a usual web camera; one 4x4 "
    "marker of 80 mm. Every photosite is the mean of 64 rays. Plain: noise of 1 % of full scale, a spot of 0.6 "
    "pixels. Hard: a spot of 1 pixel, light falling off by 40 % across the picture, flicker of 2 %, JPEG of quality 85 "
    "as well. With noise of 1 % corners that are refined one by one scatter as the published ones do, so that is the "
    "fair noise to compare with."
)
Section = Callable[..., None]
SECTIONS: tuple[tuple[Section, int], ...] = (  # and how many observations, poses or sequences each has
    (rows.safe_range, 20),
    (rows.jitter, 300),
    (rows.end_to_end, 60),
    (rendered_scenes.rendered_scenes, 14),
    (overlay_frames.silhouettes, 12),
    (overlay_frames.frame_times, 60),
)


def main(
    run: Run, parts: Parts, *, share: Annotated[float, Option(help="Of all counts; 0.1 for a first look.")] = 1.0
) -> Report:
    """Measure."""
    report = run.report("Marker sensing and overlay, on rendered pictures")
    report.note("Pictures", PICTURES)
    pieces = [(number, share) for number in range(len(SECTIONS))]
    for part in (*parts(measured, pieces[:-1]), measured(*pieces[-1])):
        report.add(part)
    return report


def measured(number: int, share: float) -> Report:
    """One section by itself."""
    cv2.setNumThreads(1)
    run, count = SECTIONS[number]
    report = Report("", "")
    run(report, max(round(share * count), 2))
    return report
