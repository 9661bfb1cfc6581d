"""A marker map with a stand and a valve, and the camera that sees them."""

from rrtik_bench.sensing.synthetic_camera import published_camera

CAMERA = published_camera((0.05, -0.12, 0.0005, -0.0007, 0.0))
MAP = """version: 1
dictionary: 4x4_50
objects:
  - {name: stand, role: base, markers: [{id: 3, side: 0.08}]}
  - name: valve
    role: target
    markers: [{id: 7, side: 0.08}]
    solids: [{name: body, box: [0.08, 0.08, 0.02], pose: {xyz: [0, 0, -0.01]}}]
    grasps: [{type: front, levels: [{xyz: [0, 0, 0.05], rpy_deg: [180, 0, 0]}]}]
"""
