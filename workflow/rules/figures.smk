"""Stage 8: figures of stages and of single images, without tables."""


rule draw_geometry:
    """Views of the meshes of a terrain, cuboids of the rocks, distances to the true surface, and arrows from annotated
    boxes to boxes of the projected meshes in a photo of every position."""
    input:
        rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
        meshes="results/{run}/meshes/Terrain{terrain}",
        cameras="results/{run}/cameras/Terrain{terrain}",
        seeds="results/{run}/acquire/Terrain{terrain}/seeds",
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        twins=f"results/{{run}}/renders/{PATHS.stand_ins[0]}/Terrain{{terrain}}" if PATHS.stand_ins else [],
        offsets="results/{run}/evaluation/offsets_Terrain{terrain}.parquet" if SOURCE.is_generated else [],
    output:
        meshes_figure=shown(
            "results/{run}/figures/meshes_Terrain{terrain}.png", "Meshes", terrain="{terrain}", picture="meshes"
        ),
        crops_figure=shown(
            "results/{run}/figures/crops_Terrain{terrain}.png", "Meshes", terrain="{terrain}", picture="cuboids"
        ),
        residuals_figure=shown("results/{run}/figures/residuals_Terrain{terrain}.png", "Cameras", terrain="{terrain}"),
        offsets_figure=(
            shown(
                "results/{run}/figures/offsets_Terrain{terrain}.png",
                "Meshes",
                terrain="{terrain}",
                picture="distance to truth",
            )
            if SOURCE.is_generated
            else []
        ),
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=5,
    script:
        "../scripts/draw_geometry.py"


# The number of outputs of a rule is fixed, so terrains with other positions than the first have a rule of their own.
(USUAL_POSITIONS, USUAL_TERRAINS), (OTHER_POSITIONS, OTHER_TERRAINS) = PATHS.positions_to_draw


rule draw_photos:
    """Photo and twins of every position, and contact sheets of all exposure brackets of a station for review."""
    input:
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        twins=expand("results/{{run}}/renders/{model}/Terrain{{terrain}}", model=MODELS),
        labels="results/{run}/labels/tables/Terrain{terrain}.parquet",
        rendered="results/{run}/renders/tables/Terrain{terrain}.parquet",
    output:
        **position_figures(USUAL_POSITIONS),
    wildcard_constraints:
        terrain=one_of(USUAL_TERRAINS),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        models=MODELS,
        stand_ins=PATHS.stand_ins,
    script:
        "../scripts/draw_photos.py"


use rule draw_photos as draw_photos_of_other_terrains with:
    output:
        **position_figures(OTHER_POSITIONS),
    wildcard_constraints:
        terrain=one_of(OTHER_TERRAINS),


rule draw_reflectance:
    """Reflectance of every model over the phase angle."""
    input:
        curves="results/{run}/renders/reflectance.csv",
    output:
        figure=shown(
            "results/{run}/figures/reflectance.png", "Photos and twins", terrain="all", position="reflectance models"
        ),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    script:
        "../scripts/draw_reflectance.py"


if PATHS.has_errata:

    rule draw_errata:
        """Defects of the published labels: page with images, and table."""
        input:
            # read through params.root
            raw=PATHS.raw_data_of_run,
            twins=expand("results/{{run}}/renders/{model}/Terrain{terrain}", model=MODELS[:1], terrain=TERRAINS),
        output:
            page=shown("results/{run}/errata.html", "Labels"),
            table="results/{run}/tables/defects.csv",
        threads: 2
        resources:
            mem_mb=memory_per_attempt(2000),
            runtime=5,
        params:
            root=str(CONFIG.source.root),
        script:
            "../scripts/draw_errata.py"


rule draw_opposition:
    """Photo and twins at the smallest and the largest phase angle."""
    input:
        cameras=of_run("results/{run}/cameras/Terrain{terrain}", terrain=TERRAINS),
        pictures=PATHS.photos_and_twins(MODELS),
    output:
        figure=shown(
            "results/{run}/figures/opposition.png", "Photos and twins", terrain="nearest", position="opposition effect"
        ),
        text="results/{run}/figures/opposition.json",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        grid=options("grid"),
        photo_domain=CONFIG.photo_domain,
        models=MODELS,
    script:
        "../scripts/draw_opposition.py"


rule draw_strip:
    """Photo, twin, difference, labels and detections."""
    input:
        photos=f"results/{{run}}/acquire/Terrain{TERRAINS[0]}/photos.parquet",
        twins=f"results/{{run}}/renders/{MODELS[-1]}/Terrain{TERRAINS[0]}",
        labels=f"results/{{run}}/labels/tables/Terrain{TERRAINS[0]}.parquet",
        predictions=PATHS.predictions_of_strip(),
    output:
        strip=directory("results/{run}/figures/strip"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        model=MODELS[-1],
        trained=CONFIG.photo_domain,
    script:
        "../scripts/draw_strip.py"


rule draw_detections:
    """Detections in photo and twins, as in figures 4 and 5 of the paper, and the rocks with the largest differences."""
    input:
        instances=PATHS.first_training("instances.parquet"),
        ipd=PATHS.first_training("ipd.parquet"),
        predictions=[
            PATHS.first_training(f"predictions/{trained}_on_{domain}.parquet")
            for trained in DOMAINS
            for domain in DOMAINS
        ],
        labels=[path for domain in DOMAINS for path in PATHS.labels(domain)],
        pictures=PATHS.photos_and_twins(DOMAINS),
    output:
        seen=detector_figures("seen", "photo and twins"),
        gap_rocks=detector_figures("gap_rocks", "rocks"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        domains=DOMAINS,
        photo_domain=CONFIG.photo_domain,
        origin=ORIGIN,
    script:
        "../scripts/draw_detections.py"
