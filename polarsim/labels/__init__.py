"""Stage 4, seed labels to labels of every photo: boxes, polygons and grey maps.

How an annotated box becomes a box in another camera, light or azimuth, step by step:

1. `seeds` reads the annotations, drops mislabelled positions and selects an annotation per position, camera, azimuth.
2. `bodies` builds ray casters for the meshes of ground and rocks, and for domes of rocks without a mesh.
3. `association` groups the boxes of the same rock and assigns the rock id.
4. `fusion` averages the boxes of a rock, moved into the target camera, with the mesh (`edge_weights`), and selects the
   labelled rocks.
5. `projection` has the geometry of steps 3 and 4: box of a mesh in a camera, box moved between the two cameras.
6. `casting` casts the shadows of rocks and walls; `shadows` combines them with annotated shadows.
7. `annotator` models the habits of annotators: edges of shadows, rocks under the rover light.
8. `brightness` reads photos or computes OLAT images; `visibility` drops labels that are invisible at an exposure.
9. `propagate` runs these steps and writes label files and the label table; `label` computes the confidence of a label.
10. `shapes` and `masks` convert boxes to polygons, grey maps and COCO masks.

`undo` lists the labels derived from an annotation. `fit_annotator` fits the coefficients of `annotator`.
"""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    LabelsOptions="options",
    propagate_labels="propagate",
    draw_masks="masks",
)
