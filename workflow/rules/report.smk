"""Stage 8: tables with their figures, and the results page."""

from polarsim.formats.release import label_folder


rule rock_sizes:
    """Tables of rock sizes and abundances, and their figure."""
    input:
        of_run("results/{run}/tables/rock_sizes.csv"),
        of_run("results/{run}/figures/rock_sizes.png"),


rule geometry:
    """Tables of cameras, alignments, rocks and meshes with evaluation, without labels and twins."""
    input:
        rules.rock_sizes.input,
        of_run("results/{run}/tables/{name}.csv", name=["cameras", "rocks"]),
        PATHS.figures_of_geometry(),


rule tables:
    """All outputs of this stage."""
    input:
        rules.geometry.input,
        of_run("results/{run}/tables/{name}.csv", name=["evaluation", "render", "appearance"]),
        PATHS.tables_of_detectors(),
        PATHS.figures_of_detectors(),
        of_run("results/{run}/tables/stereo.csv") if PATHS.has_stereo else [],
        of_run("results/{run}/results.html"),
        PATHS.figures_of_stages(),
        of_run("results/{run}/errata.html") if PATHS.has_errata else [],
        of_run("results/{run}/tables/labels.csv") if PATHS.scored_terrains else [],


rule tabulate_evaluation:
    """The evaluation of every stage in one table, and the evaluation of twins by terrain, position, azimuth, light and
    camera."""
    input:
        parts=PATHS.evaluation_parts,
        appearance=expand("results/{{run}}/evaluation/appearance_Terrain{terrain}.parquet", terrain=TERRAINS),
        twins=expand("results/{{run}}/evaluation/twins_Terrain{terrain}.csv", terrain=TERRAINS),
    output:
        **table_files(evaluation="evaluation of every stage", render="twins"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        origin=ORIGIN,
    script:
        "../scripts/tabulate_evaluation.py"


rule report_appearance:
    """Appearance of twins next to their photos: table, and figure of photos, twins and differences."""
    input:
        appearance=expand("results/{{run}}/evaluation/appearance_Terrain{terrain}.parquet", terrain=TERRAINS),
        photos=PATHS.photos_or_covers,
        twins=expand("results/{{run}}/renders/{model}/Terrain{terrain}", model=MODELS, terrain=TERRAINS),
        drawn=COVERS.instead_of_photos("drawn"),
    output:
        **table_files(appearance="appearance of twins", appearance_differences=None),
        figure=shown("results/{run}/figures/appearance.png", "Photos and twins", terrain="all", position="appearance"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/report_appearance.py"


rule tabulate_geometry:
    """Tables of cameras, alignments, rocks and meshes of all terrains."""
    input:
        cameras=expand("results/{{run}}/cameras/Terrain{terrain}", terrain=TERRAINS),
        rocks=expand("results/{{run}}/rocks/Terrain{terrain}/rocks.parquet", terrain=TERRAINS),
        evaluation=expand(
            "results/{{run}}/evaluation/{stage}_Terrain{terrain}.csv",
            stage=["cameras", "rocks"],
            terrain=TERRAINS,
        ),
        mesh_scores=expand("results/{{run}}/evaluation/meshes_Terrain{terrain}.csv", terrain=TERRAINS),
    output:
        **table_files(cameras="cameras", alignment=None, rocks="rocks", meshes="meshes"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        terrains=CONFIG.terrains,
        origin=ORIGIN,
    script:
        "../scripts/tabulate_geometry.py"


rule report_rock_sizes:
    """Sizes of the rocks of all terrains and their errors, and size-frequency distributions with a fitted law."""
    input:
        sizes=expand("results/{{run}}/rocks/Terrain{terrain}/sizes.parquet", terrain=TERRAINS),
        areas=expand("results/{{run}}/rocks/Terrain{terrain}/area.json", terrain=TERRAINS),
        true_sizes=(
            expand("results/{{run}}/evaluation/rock_sizes_Terrain{terrain}.parquet", terrain=TERRAINS)
            if SOURCE.is_generated
            else []
        ),
    output:
        **table_files(rock_sizes="rock sizes", rock_abundance="rock abundance"),
        figure=shown("results/{run}/figures/rock_sizes.png", "Meshes", terrain="all", picture="rock sizes"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        terrains=CONFIG.terrains,
        origin=ORIGIN,
    script:
        "../scripts/report_rock_sizes.py"


if CONFIG.photo_domain in DOMAINS:

    rule measure_diameters:
        """Diameters of rocks on level ground from detections in photos alone, merged over the photos of a terrain."""
        input:
            predictions=PATHS.first_training(f"predictions/{CONFIG.photo_domain}_on_{CONFIG.photo_domain}.parquet"),
            cameras=expand("results/{{run}}/cameras/Terrain{terrain}", terrain=TERRAINS),
        output:
            diameters="results/{run}/detect/rock_diameters.parquet",
        resources:
            mem_mb=memory_per_attempt(500),
            runtime=5,
        params:
            terrains=CONFIG.terrains,
        script:
            "../scripts/measure_diameters.py"

    rule report_rock_diameters:
        """Diameters and abundance of rocks from detections alone."""
        input:
            diameters="results/{run}/detect/rock_diameters.parquet",
            areas=expand("results/{{run}}/rocks/Terrain{terrain}/area.json", terrain=TERRAINS),
        output:
            **table_files(rock_diameters="rock diameters from detections"),
        resources:
            mem_mb=memory_per_attempt(500),
            runtime=5,
        params:
            terrains=CONFIG.terrains,
            origin=ORIGIN,
        script:
            "../scripts/report_rock_diameters.py"

    rule rock_diameters:
        """Table of rock diameters from detections alone; not part of the default report."""
        input:
            of_run("results/{run}/tables/rock_diameters.csv"),


rule elsewhere:
    """Evaluation of the packaged detector on the folders of `detect.elsewhere`; not part of the default report."""
    input:
        of_run("results/{run}/tables/elsewhere.csv") if CONFIG.detect.elsewhere else [],


rule tabulate_elsewhere:
    """Evaluation of the packaged detector on images from outside POLAR."""
    input:
        scores=required(
            expand("results/{{run}}/detect/elsewhere/{name}.parquet", name=CONFIG.detect.elsewhere),
            "detect.elsewhere: no folders of images, but a table of their scores is requested",
        ),
    output:
        **table_files(elsewhere="images from outside POLAR"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/tabulate_elsewhere.py"


rule report_label_scores:
    """Accuracy of labels by task, terrain, position, azimuth and size, and reliability of their confidence: tables and
    figures."""
    input:
        pairs=required(
            expand("results/{{run}}/evaluation/label_pairs_Terrain{terrain}.parquet", terrain=PATHS.scored_terrains),
            f"no reference labels of the run's terrains, expected {label_folder(CONFIG.annotated_root, CONFIG.terrains[0])};"
            " scoring.annotated_root sets the folder of reference labels",
        ),
    output:
        **table_files(labels="labels", reliability=None),
        label_errors=[
            shown(
                f"results/{{run}}/figures/label_errors_Terrain{terrain}.png",
                "Labels",
                "figures/label_errors",
                terrain=terrain,
            )
            for terrain in PATHS.scored_terrains
        ],
        reliability_figure=shown("results/{run}/figures/reliability.png", "Labels", terrain="all", picture="confidence"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        seeds=PATHS.seeds_text,
        terrains=PATHS.scored_terrains,
        origin=ORIGIN,
    script:
        "../scripts/report_label_scores.py"


rule report_detectors:
    """Tables and figures of detectors: detection and IPD of every pair of domains, breakdowns, paired differences,
    precision over recall, individual rocks."""
    input:
        others=PATHS.detection_of_others,
        detection="results/{run}/detect/detection.parquet",
        differences="results/{run}/detect/differences.parquet",
        breakdown="results/{run}/detect/breakdown.parquet",
        curves="results/{run}/detect/curves.parquet",
        false_positives="results/{run}/detect/false_positives.parquet",
        ipd="results/{run}/detect/ipd.parquet",
        rocks="results/{run}/detect/rocks.parquet",
    output:
        # written through detection
        **table_files(
            detection="detection",
            differences="paired differences",
            detection_breakdown="detection, broken down",
            false_positives="false positives",
            ipd="IPD",
            ipd_rocks="IPD, rock by rock",
        ),
        detection_figure=shown("results/{run}/figures/detection.png", "Detection", picture="detection"),
        curves_figure=shown("results/{run}/figures/precision_recall.png", "Detection", picture="precision and recall"),
        ipd_figure=shown("results/{run}/figures/ipd.png", "Detection", picture="IPD"),
        rocks_figure=shown("results/{run}/figures/ipd_histogram.png", "Detection", picture="IPD of rocks"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        origin=ORIGIN,
    script:
        "../scripts/report_detectors.py"


rule tabulate_stereo:
    """Stereo depth against the meshes, in every domain."""
    input:
        stereo="results/{run}/detect/stereo.parquet",
        instances="results/{run}/detect/stereo_instances.parquet",
        ipd="results/{run}/detect/stereo_ipd.parquet",
    output:
        **table_files(stereo="stereo depth"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/tabulate_stereo.py"


rule write_results_page:
    """Summary page of the run: metrics, images, all tables and figures."""
    input:
        tables=PATHS.tables_of_page(),
        figures=PATHS.figures_of_page(),
        strip=[] if PATHS.only_covers else "results/{run}/figures/strip",
        photos=[] if PATHS.only_covers else "results/{run}/acquire/photos.parquet",
        phases=of_run("results/{run}/figures/opposition.json") if DOMAINS else [],
        datasets=of_run("results/{run}/detect/{split}/datasets/{trained}", split=SPLITS, trained=TRAINED),
    output:
        page=shown("results/{run}/results.html", "Results"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        datasets=[(split, trained) for split in SPLITS for trained in TRAINED],
        origin=ORIGIN,
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        models=MODELS,
        photo_domain=CONFIG.photo_domain,
        others=PATHS.further_pages(),
    script:
        "../scripts/write_results_page.py"
