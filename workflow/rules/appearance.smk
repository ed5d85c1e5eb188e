"""Photos with twins before and after what was fitted to photos: light and materials, ground."""


rule before_after:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/figures/before_after.png"),


use rule render_control as render_unrefined with:
    """Twins of the cover photos of a terrain on the ground before it was refined by photos."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes=PATHS.unrefined_meshes,
        photos="results/{run}/covers/photos",
    output:
        twins=directory("results/{run}/covers/unrefined/pictures/Terrain{terrain}"),
        boxes=directory("results/{run}/covers/unrefined/boxes/Terrain{terrain}"),
        instances=directory("results/{run}/covers/unrefined/instances/Terrain{terrain}"),
        annotations="results/{run}/covers/unrefined/coco/Terrain{terrain}.json",
        table="results/{run}/covers/unrefined/tables/Terrain{terrain}.parquet",


rule draw_before_after:
    """Photos, a twin before and a twin after what was fitted to photos, and the difference of the latter."""
    input:
        appearance=expand("results/{{run}}/evaluation/appearance_Terrain{terrain}.parquet", terrain=TERRAINS),
        photos=PATHS.photos_or_covers,
        drawn=COVERS.instead_of_photos("drawn"),
        before=existing(COVERS.twins_before),
        after=COVERS.twins_after(),
    output:
        figure=shown("results/{run}/figures/before_after.png", "Photos and twins", terrain="all", position="fits"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        before_title=COVERS.title_before,
        after_model=COVERS.model_after,
    script:
        "../scripts/draw_before_after.py"
