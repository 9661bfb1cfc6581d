"""Stands in for viser where that is not installed: keeps what is added to the scene, draws nothing."""


class Handle:
    """What has been added: its attributes are what was asked for, its callbacks are called when its value changes."""

    def __init__(self, **properties):
        self.__dict__.update({"visible": True, "callbacks": [], **properties})

    def __setattr__(self, name, value):
        self.__dict__[name] = value
        if name == "value":
            for callback in self.callbacks:
                callback(None)

    def on_update(self, callback):
        self.callbacks.append(callback)
        return callback


class Scene:
    def __init__(self):
        self.added = {}

    def _add(self, name, **properties):
        self.added[name] = Handle(**properties)
        return self.added[name]

    def add_frame(self, name, show_axes=True, *, axes_length=0.5, axes_radius=0.025):
        return self._add(name)

    def add_box(self, name, *, dimensions, color, opacity):
        return self._add(name, dimensions=dimensions)

    def add_mesh_simple(
        self, name, vertices, faces, *, color=None, opacity=None, position=(0, 0, 0), wxyz=(1, 0, 0, 0)
    ):
        return self._add(name, vertices=vertices, faces=faces, position=position, wxyz=wxyz)

    def add_icosphere(self, name, *, radius, color, opacity):
        return self._add(name, radius=radius)

    def add_mesh_trimesh(self, name, mesh):
        return self._add(name, mesh=mesh)

    def add_spline_catmull_rom(self, name, points, *, thickness, color):
        return self._add(name, points=points)


class Gui:
    def add_slider(self, label, *, min, max, step, initial_value):
        return Handle(value=initial_value, min=min, max=max, step=step)


class ViserServer:
    def __init__(self):
        self.scene, self.gui, self.initial_camera = Scene(), Gui(), Handle()
