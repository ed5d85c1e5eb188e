"""Stage 4, seed labels to labels of every photo: boxes, polygons and grey maps.

How an annotated box becomes a box in another camera, light or azimuth, step by step:

1. `seeds` reads the annotations, drops those of other positions and chooses one for each position, camera and azimuth.
2. `bodies` builds the meshes of ground and rocks, and stand-ins of rocks without a mesh, for rays.
3. `association` groups the boxes of one rock and gives them the id of the rock.
4. `fusion` averages the boxes of a rock, moved into the other camera, with its mesh, and selects the labelled rocks.
5. `projection` has the geometry of steps 3 and 4: the box of a mesh in a camera, and a box moved to the other camera.
6. `casting` casts the shadows of rocks and walls; `shadows` combines them with annotated shadows.
7. `annotator` applies the habits of annotators: edges of shadows, rocks under the rover light.
8. `brightness` reads photos or makes OLAT images; `visibility` drops the labels that an exposure does not show.
9. `propagate` runs these steps and writes label files and the label table; `label` gives each label its confidence.
10. `shapes` and `masks` turn boxes into polygons, grey maps and COCO masks.

`undo` lists the labels that follow from one annotation. `fit_annotator` fits the coefficients of `annotator`.
"""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    LabelsOptions="options",
    propagate_labels="propagate",
    draw_masks="masks",
)
