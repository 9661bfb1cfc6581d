"""Options of commands that write films and pictures, and how they are written: with a bar, and whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.cli.terminal import counter, progress
from rrtik_ompl.files.text import FILM_FORMATS, PICTURE_FORMATS, check_target

if TYPE_CHECKING:
    from rrtik_ompl.replanning.record import ReplanRun

FilmFile = Annotated[Path | None, typer.Option(help="Write a film: .mp4, .webm, .gif. A headless browser draws it.")]
PictureFile = Annotated[Path | None, typer.Option(help="Write a still picture: .png.")]
Rate = Annotated[float | None, typer.Option(help="Pictures a second of a film; 30, of a .gif 12.")]
Size = Annotated[
    str | None, typer.Option(help="Width and height [px], such as 1920x1080; 1280x720, of a .gif 640x400.")
]
Camera = Annotated[
    str, typer.Option(help="overview, front, side, top, orbit, follow, or a file of views, as a page saves it.")
]
Hide = Annotated[
    str, typer.Option(help="What films and pictures leave out: ghosts,trails,labels,frames,grid,... or names.")
]


class Filming(NamedTuple):
    """What a command was asked to film, and how.

    Attributes:
        film: The film; None for none.
        picture: The picture; None for none.
        rate: Pictures a second.
        size: Width and height.
        camera: The camera.
        hide: What is left out.
    """

    film: Path | None
    picture: Path | None
    rate: float | None
    size: str | None
    camera: str
    hide: str

    def check(self) -> None:
        """Refuse what cannot be written, before any work is done.

        Raises:
            InputError: If a file cannot be written, the camera is unknown, or the size does not fit.
        """
        check_target(self.film, FILM_FORMATS)
        check_target(self.picture, PICTURE_FORMATS)
        if self.film is None and self.picture is None:
            given = {"--rate": self.rate, "--size": self.size, "--hide": self.hide or None}
            wrong = [option for option, value in given.items() if value is not None]
            if self.camera != "overview":
                wrong.append("--camera")
            if wrong:
                raise InputError(f"{wrong[0]} is for --film and --picture: give one of them, or leave it out")
            return

        from rrtik_ompl.viewer.film_view import camera_of, sides_of

        camera_of(self.camera)
        for file in (self.film, self.picture):
            if file is not None and self.size is not None:
                sides_of(self.size, file.suffix.lower())

    def write(
        self,
        shown: Any,  # noqa: ANN401 - whatever a page shows
        path: Any,  # noqa: ANN401
        *,
        run: ReplanRun | None = None,
        seconds: float | None = None,
    ) -> list[Path]:
        """Write the film and the picture.

        Args:
            shown: What a page shows.
            path: What is played.
            run: A run in place of a path.
            seconds: Duration of the film [s].

        Returns:
            The files that were written.
        """
        if self.film is None and self.picture is None:
            return []
        from rrtik_ompl.viewer.film import SIZE, film, picture

        given: dict[str, Any] = {"run": run, "camera": self.camera, "hide": self.hide}
        if self.picture is not None:
            with progress("drawing"):
                picture(shown, self.picture, path, size=SIZE if self.size is None else self.size, **given)
        if self.film is not None:
            with counter("drawing", 1) as drawn:
                film(shown, self.film, path, rate=self.rate, size=self.size, seconds=seconds, on_picture=drawn, **given)
        return [file for file in (self.film, self.picture) if file is not None]
