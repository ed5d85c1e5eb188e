"""Stage 5: twins of every photo, and their exact labels."""


rule render:
    """Everything of this stage."""
    input:
        of_run("results/{run}/renders/{model}/Terrain{terrain}", model=MODELS, terrain=TERRAINS),
        of_run("results/{run}/renders/boxes/Terrain{terrain}", terrain=TERRAINS),
        of_run("results/{run}/renders/labels.parquet"),
        of_run("results/{run}/renders/reflectance.csv"),


rule fit_materials:
    """Albedo, the models' parameters and the lamps' brightness, fitted to the photos of a terrain."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos=PATHS.photos_of_terrain,
    output:
        materials=directory("results/{run}/renders/materials/Terrain{terrain}"),
    priority: TWINS_WAIT
    resources:
        mem_mb=growing(6000),
        runtime=30,
    params:
        models=MODELS,
        options=options("render"),
    script:
        "../scripts/fit_materials.py"


rule render_twins:
    """The twin of every photo of a terrain under every reflectance model, and their exact labels, from the same rays."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos=PATHS.photos_of_terrain,
        materials=PATHS.materials_of_terrain,
    output:
        twins=directory(expand("results/{{run}}/renders/{model}/Terrain{{terrain}}", model=MODELS)),
        maps=directory("results/{run}/renders/maps/Terrain{terrain}") if CONFIG.render.maps else [],
        boxes=directory("results/{run}/renders/boxes/Terrain{terrain}"),
        instances=directory("results/{run}/renders/instances/Terrain{terrain}"),
        annotations="results/{run}/renders/coco/Terrain{terrain}.json",
        table="results/{run}/renders/tables/Terrain{terrain}.parquet",
    priority: TWINS_WAIT
    resources:
        mem_mb=growing(3000),
        runtime=30,
        gpu=PATHS.gpus("render"),
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        models=MODELS,
        options=options("render"),
    script:
        "../scripts/render_twins.py"


rule write_reflectance:
    """How bright every reflectance model is over the phase angle, with the run's parameters."""
    output:
        curves="results/{run}/renders/reflectance.csv",
    priority: TWINS_WAIT
    resources:
        mem_mb=growing(500),
        runtime=5,
    params:
        options=options("render"),
    script:
        "../scripts/write_reflectance.py"


use rule merge_labels as merge_twin_labels with:
    """One table of the labels of all twins."""
    input:
        tables=of_run("results/{run}/renders/tables/Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/renders/labels.parquet",
    priority: TWINS_WAIT
