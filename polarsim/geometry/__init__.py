"""Pure arrays in, arrays out: poses, lenses, rays, boxes, polygons."""
