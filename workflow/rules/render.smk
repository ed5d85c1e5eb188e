"""Stage 5: twins of every photo with exact labels."""


rule render:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/renders/{model}/Terrain{terrain}", model=MODELS, terrain=TERRAINS),
        of_run("results/{run}/renders/boxes/Terrain{terrain}", terrain=TERRAINS),
        of_run("results/{run}/renders/labels.parquet"),
        of_run("results/{run}/renders/reflectance.csv"),


rule fit_light:
    """Light fields of the Sun lamps, fitted to the photos of all terrains."""
    input:
        cameras=expand("results/{{run}}/cameras/Terrain{terrain}", terrain=TERRAINS),
        meshes=expand("results/{{run}}/meshes/Terrain{terrain}", terrain=TERRAINS),
        photos=PATHS.photos_or_covers,
    output:
        light=expand("results/{{run}}/renders/light/Terrain{terrain}.json", terrain=TERRAINS),
    priority: TWINS_WAIT
    resources:
        mem_mb=memory_per_attempt(3000),
        runtime=30,
    params:
        terrains=list(CONFIG.terrains),
        domains=list(CONFIG.domains_to_fit),
        options=options("render"),
    script:
        "../scripts/fit_light.py"


rule fit_materials:
    """Albedo, model parameters and lamp brightness, fitted to the photos of a terrain."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos=PATHS.photos_of_terrain,
        light=PATHS.fitted_light,
    output:
        materials=directory("results/{run}/renders/materials/Terrain{terrain}"),
    priority: TWINS_WAIT
    resources:
        mem_mb=memory_per_attempt(6000),
        runtime=30,
    params:
        domains=list(CONFIG.domains_to_fit),
        options=options("render"),
    script:
        "../scripts/fit_materials.py"


rule render_twins:
    """Twins of every photo of a terrain in every domain, and exact labels."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos=PATHS.photos_of_terrain,
        materials=PATHS.materials_of_terrain,
        light=PATHS.light_of_terrain,
    output:
        twins=directory(expand("results/{{run}}/renders/{model}/Terrain{{terrain}}", model=MODELS)),
        maps=directory("results/{run}/renders/maps/Terrain{terrain}") if CONFIG.render.maps else [],
        boxes=directory("results/{run}/renders/boxes/Terrain{terrain}"),
        instances=directory("results/{run}/renders/instances/Terrain{terrain}"),
        annotations="results/{run}/renders/coco/Terrain{terrain}.json",
        table="results/{run}/renders/tables/Terrain{terrain}.parquet",
    priority: TWINS_WAIT
    resources:
        mem_mb=memory_per_attempt(3000),
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
    """Reflectance of every model over the phase angle, with the parameters of the run."""
    output:
        curves="results/{run}/renders/reflectance.csv",
    priority: TWINS_WAIT
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        options=options("render"),
    script:
        "../scripts/write_reflectance.py"


use rule merge_labels as merge_twin_labels with:
    """Table of the labels of all twins."""
    input:
        tables=of_run("results/{run}/renders/tables/Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/renders/labels.parquet",
    priority: TWINS_WAIT
