"""Relief of the ground from photos: height maps with their uncertainty and origin.

Steps of `refine.refine_ground`, which runs after the cameras:

1. photos: photos of the ground with poses and lamps; exposures of own photos are merged.
2. refine.start_map: heights of the ground mesh on a grid.
3. pairs: views with comparable patterns.
4. sweep: heights at which their orthophotos (views) agree, by semi-global aggregation; feet and plate fill the rest.
5. shading: the relief of cover photos, by equations, observations and multigrid; agreement checks the photos.
6. feet: published rocks are continued down to the ground.
"""
