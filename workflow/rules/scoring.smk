"""Stage 7: scores against ground truth or annotations, and consistency. Only scoring reads ground truth."""


rule score_geometry:
    """Poses, rocks and meshes of a terrain: compared with ground truth or annotated boxes, and with each other."""
    input:
        raw=PATHS.raw_data,  # read through params.truth
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
        meshes="results/{run}/meshes/Terrain{terrain}",
        located="results/{run}/cameras/located/Terrain{terrain}",
        cameras="results/{run}/cameras/Terrain{terrain}",
        photos=PATHS.photos_of_terrain,
    output:
        cameras="results/{run}/evaluation/cameras_Terrain{terrain}.csv",
        rocks="results/{run}/evaluation/rocks_Terrain{terrain}.csv",
        meshes="results/{run}/evaluation/meshes_Terrain{terrain}.csv",
        offsets="results/{run}/evaluation/offsets_Terrain{terrain}.parquet",
        consistency="results/{run}/evaluation/consistency_Terrain{terrain}.csv",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=20,
    params:
        truth=PATHS.truth,
        annotated=PATHS.annotated_labels,
    script:
        "../scripts/score_geometry.py"


rule find_true_sizes:
    """True sizes of measured rocks, of the part above the ground and of the entire rock."""
    input:
        raw=PATHS.raw_data,  # read through params.truth
        sizes="results/{run}/rocks/Terrain{terrain}/sizes.parquet",
        rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
        located="results/{run}/cameras/located/Terrain{terrain}",
    output:
        true_sizes="results/{run}/evaluation/rock_sizes_Terrain{terrain}.parquet",
    wildcard_constraints:
        terrain=one_of(TERRAINS if SOURCE.is_generated else []),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        truth=PATHS.truth,
    script:
        "../scripts/find_true_sizes.py"


rule score_labels:
    """Labels of every photo against ground truth or annotations, by propagation task."""
    input:
        raw=PATHS.raw_data,  # read through params.truth
        table="results/{run}/labels/tables/Terrain{terrain}.parquet",
        seeds="results/{run}/acquire/Terrain{terrain}/seeds",
    output:
        evaluation="results/{run}/evaluation/labels_Terrain{terrain}.csv",
        pairs="results/{run}/evaluation/label_pairs_Terrain{terrain}.parquet",
    wildcard_constraints:
        terrain=one_of(PATHS.scored_terrains),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        truth=PATHS.true_labels,
    script:
        "../scripts/score_labels.py"


rule score_outlines:
    """Outlines of rocks and shadows against annotated polygons."""
    input:
        raw=PATHS.raw_data,  # read through params.root
        polygons=PATHS.annotated_polygons,  # read through params.root
        annotations="results/{run}/labels/coco/Terrain{terrain}.json",
    output:
        evaluation="results/{run}/evaluation/outlines_Terrain{terrain}.csv",
    wildcard_constraints:
        terrain=one_of(PATHS.outlined_terrains),
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=10,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        root=str(CONFIG.annotated_root),
    script:
        "../scripts/score_outlines.py"


rule score_masks:
    """Masks of cover photos by detectors that were trained on other terrains, against annotated polygons."""
    input:
        masks=COVERS.masks(),
        polygons=required(  # read through params.root
            PATHS.annotated_polygons_of_covers(),
            f"{CONFIG.annotated_root}: masks are compared with annotated polygons of cover photos, expected such polygons"
            " and detect.training.masks: true",
        ),
    output:
        scores="results/{run}/covers/mask_scores.parquet",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        root=str(CONFIG.annotated_root),
        resamples=CONFIG.detect.comparison.resamples,
    script:
        "../scripts/score_masks.py"


rule score_twins:
    """Rendered boxes against ground truth or annotations, and twins against photos or published cover photos."""
    input:
        raw=PATHS.raw_data,  # read through params.truth
        boxes="results/{run}/renders/boxes/Terrain{terrain}",
        twins=expand("results/{{run}}/renders/{model}/Terrain{{terrain}}", model=MODELS),
        others=PATHS.twins_of_another_terrain,
        materials=PATHS.materials_of_terrain,
        light=PATHS.light_of_terrain,
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        covers=COVERS.instead_of_photos("photos"),
        drawn=COVERS.instead_of_photos("drawn"),
        instances="results/{run}/renders/instances/Terrain{terrain}",
    output:
        evaluation="results/{run}/evaluation/twins_Terrain{terrain}.csv",
        appearance="results/{run}/evaluation/appearance_Terrain{terrain}.parquet",
    priority: TABLES_WAIT
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=20,
    params:
        truth=PATHS.true_labels,
        models=MODELS,
    script:
        "../scripts/score_twins.py"


rule score_materials:
    """Fitted albedo against ground truth, and twins against held-out photos."""
    input:
        raw=PATHS.raw_data,  # read through params.truth
        materials="results/{run}/renders/materials/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        cameras="results/{run}/cameras/Terrain{terrain}",
    output:
        evaluation="results/{run}/evaluation/materials_Terrain{terrain}.csv",
    wildcard_constraints:
        terrain=one_of(TERRAINS if SOURCE.is_generated else []),
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=10,
    params:
        truth=PATHS.truth,
    script:
        "../scripts/score_materials.py"
