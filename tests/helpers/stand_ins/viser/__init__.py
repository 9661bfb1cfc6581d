"""Stands in for viser where that is not installed: keeps what is added to the scene, draws nothing."""

from collections.abc import Callable
from typing import Any


class Handle:
    """What has been added: its attributes are what was asked for, its callbacks are called when its value changes."""

    def __init__(self, **properties: Any) -> None:
        self.__dict__.update({"visible": True, "callbacks": [], **properties})

    def __setattr__(self, name: str, value: Any) -> None:
        self.__dict__[name] = value
        if name == "value":
            for callback in self.__dict__["callbacks"]:
                callback(None)

    def on_update(self, callback: Callable[[object], None]) -> Callable[[object], None]:
        self.__dict__["callbacks"].append(callback)
        return callback


class Scene:
    def __init__(self) -> None:
        self.added: dict[str, Handle] = {}

    def _add(self, name: str, **properties: Any) -> Handle:
        self.added[name] = Handle(**properties)
        return self.added[name]

    def add_frame(
        self, name: str, show_axes: bool = True, *, axes_length: float = 0.5, axes_radius: float = 0.025
    ) -> Handle:
        return self._add(name)

    def add_box(self, name: str, *, dimensions: Any, color: Any, opacity: Any) -> Handle:
        return self._add(name, dimensions=dimensions)

    def add_icosphere(self, name: str, *, radius: float, color: Any, opacity: Any) -> Handle:
        return self._add(name, radius=radius)

    def add_mesh_simple(
        self, name: str, vertices: Any, faces: Any, *, color: Any = None, opacity: Any = None
    ) -> Handle:
        return self._add(name, vertices=vertices, faces=faces)

    def add_mesh_trimesh(self, name: str, mesh: Any) -> Handle:
        return self._add(name, mesh=mesh)

    def add_spline_catmull_rom(self, name: str, points: Any, *, thickness: float, color: Any) -> Handle:
        return self._add(name, points=points)


class Gui:
    def add_slider(self, label: str, *, min: float, max: float, step: float, initial_value: float) -> Handle:
        return Handle(value=initial_value, min=min, max=max, step=step)


class ViserServer:
    def __init__(self) -> None:
        self.scene, self.gui, self.initial_camera = Scene(), Gui(), Handle()
