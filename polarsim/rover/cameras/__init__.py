"""Pictures of the rover's cameras with exact labels.

Steps in order: `options`, `lights` (Suns and headlights), `bodywork` (the rover's body as a mesh), `tracks` and
`grouser_marks` (the ground with ruts and prints), `render_scene` (all surfaces at a moment), `rover_camera` (a picture
of a moment), `suite` (the pictures of a recorded drive), `frames` (their files), `layout` (names of files and columns).
"""
