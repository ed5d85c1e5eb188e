"""Images of the rover's cameras with exact labels.

Steps in order: `options`, `lights` (Suns and headlights), `bodywork` (mesh of the rover's body), `tracks` (ground with
ruts and prints), `render_scene` (all surfaces at a time), `rover_camera` (an image at a time), `suite` (images of a
recorded drive), `frames` (image and label files), `layout` (names of files and columns).
"""
