"""Labelled images of novel viewpoints, defined by a views file.

1. options: content of the views file. `cameras` places cameras.
2. plan: lights (`moon` computes the Sun over a lunar site) and the grid of images.
3. run: render each camera once and expose every image; `stars` renders the sky.
4. folder: files of an image, contact sheet and listings.
"""
