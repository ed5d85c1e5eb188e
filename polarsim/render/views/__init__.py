"""Labelled pictures of novel viewpoints, from a file of views.

1. options: the file's content. `scenes` joins its terrains, `cameras` places its cameras.
2. plan: lights (`moon` gives the Sun over a lunar site) and the grid of pictures.
3. run: each camera rendered once, exposed for every picture; `stars` fills the sky.
4. folder: the files of a picture, the contact sheet, the lists.
"""
