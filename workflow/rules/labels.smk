"""Stage 4: seed labels propagated to every photo of the grid."""


rule labels:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/labels/labels.parquet"),
        of_run("results/{run}/labels/boxes/Terrain{terrain}", terrain=TERRAINS),
        of_run("results/{run}/labels/polygons/Terrain{terrain}", terrain=TERRAINS),
        of_run("results/{run}/labels/masks/Terrain{terrain}", terrain=TERRAINS),
        of_run("results/{run}/labels/coco/Terrain{terrain}.json", terrain=TERRAINS),


rule propagate_labels:
    """Boxes of every photo of a terrain, propagated from annotated photos."""
    input:
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        seeds="results/{run}/acquire/Terrain{terrain}/seeds",
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        corrections=PATHS.corrections,  # read through params.options
    output:
        boxes=directory("results/{run}/labels/boxes/Terrain{terrain}"),
        table="results/{run}/labels/tables/Terrain{terrain}.parquet",
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=20,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        options=options("labels"),
    script:
        "../scripts/propagate_labels.py"


rule draw_masks:
    """Polygons, class masks and COCO masks of every photo of a terrain."""
    input:
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        table="results/{run}/labels/tables/Terrain{terrain}.parquet",
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
    output:
        polygons=directory("results/{run}/labels/polygons/Terrain{terrain}"),
        masks=directory("results/{run}/labels/masks/Terrain{terrain}"),
        preview="results/{run}/labels/masks/Terrain{terrain}_preview.png",
        annotations="results/{run}/labels/coco/Terrain{terrain}.json",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=20,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
    script:
        "../scripts/draw_masks.py"


rule merge_labels:
    """Table of all labels."""
    input:
        tables=of_run("results/{run}/labels/tables/Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/labels/labels.parquet",
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    script:
        "../scripts/merge_labels.py"
