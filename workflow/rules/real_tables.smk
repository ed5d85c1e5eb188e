"""The two tables of the paper on real photos: detectors of cover photos and of their twins, evaluated on both domains.

The domain `control` has twins on a ground with invented relief. It is evaluated only.
"""

COMPARED = ["detection", "ipd", "differences", "instances"]  # tables of `compare_domains` with a row of every detector


wildcard_constraints:
    cover_domain=one_of(COVERS.evaluated),


rule real_tables:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/tables/real_{table}.csv", table=["detection", "ipd", "differences", "photos"]),
        of_run("results/{run}/figures/real_{figure}.png", figure=["ipd", "pairs", "gap"]),


rule pair_covers_with_twins:
    """Images and labels of every domain: cover photos with human boxes, and their twins with rendered boxes."""
    input:
        photos="results/{run}/covers/photos",
        annotated="results/{run}/covers/labels.parquet",
        propagated="results/{run}/labels/labels.parquet",  # rock ids of the human boxes
        # read through params.twins
        twins=of_run("results/{run}/renders/{model}/Terrain{terrain}", model=MODELS, terrain=TERRAINS),
        rendered="results/{run}/renders/labels.parquet",
    output:
        pictures=directory(expand("results/{{run}}/covers/domains/pictures/{domain}", domain=COVERS.domains)),
        labels=expand("results/{{run}}/covers/domains/labels/{domain}.parquet", domain=COVERS.domains),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    params:
        domains=COVERS.domains,
        twins={model: COVERS.folders_of_twins[model] for model in MODELS},
        photo_domain=CONFIG.photo_domain,
    script:
        "../scripts/pair_covers_with_twins.py"


rule invent_relief:
    """Meshes of a terrain with invented relief of the ground."""
    input:
        meshes="results/{run}/meshes/Terrain{terrain}",
    output:
        control=directory("results/{run}/covers/control/meshes/Terrain{terrain}"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        seed=CONFIG.covers.scenes.seed,
    script:
        "../scripts/invent_relief.py"


rule render_control:
    """Twins of the cover photos of a terrain with invented relief, and labels."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/covers/control/meshes/Terrain{terrain}",
        photos=f"results/{{run}}/covers/domains/pictures/{CONFIG.photo_domain}",
    output:
        twins=directory("results/{run}/covers/control/pictures/Terrain{terrain}"),
        boxes=directory("results/{run}/covers/control/boxes/Terrain{terrain}"),
        instances=directory("results/{run}/covers/control/instances/Terrain{terrain}"),
        annotations="results/{run}/covers/control/coco/Terrain{terrain}.json",
        table="results/{run}/covers/control/tables/Terrain{terrain}.parquet",
    resources:
        mem_mb=memory_per_attempt(3000),
        runtime=30,
        gpu=PATHS.gpus("render"),
    params:
        model=(CONFIG.compared_models or MODELS)[0],  # a fitted twin needs fits to photos
        options=options("render"),
    script:
        "../scripts/render_control.py"


use rule merge_labels as merge_control_labels with:
    """Table of the labels of the twins with invented relief."""
    input:
        tables=of_run("results/{run}/covers/control/tables/Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/covers/control/labels.parquet",


rule convert_control:
    """Images and labels of the control."""
    input:
        photos=f"results/{{run}}/covers/domains/pictures/{CONFIG.photo_domain}",
        twins=of_run("results/{run}/covers/control/pictures/Terrain{terrain}", terrain=TERRAINS),
        rendered="results/{run}/covers/control/labels.parquet",
    output:
        pictures=directory(f"results/{{run}}/covers/domains/pictures/{COVERS.evaluated[-1]}"),
        labels=f"results/{{run}}/covers/domains/labels/{COVERS.evaluated[-1]}.parquet",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=10,
    script:
        "../scripts/convert_control.py"


use rule cut_windows as cut_domain_windows with:
    """Windows of the images of a domain for training."""
    input:
        photos="results/{run}/covers/domains/pictures/{cover_domain}",
        labels="results/{run}/covers/domains/labels/{cover_domain}.parquet",
    output:
        windows=directory("results/{run}/covers/domains/windows/{cover_domain}"),


rule make_twin_dataset:
    """Data set of a fold and domain: windows of other terrains for training, images of the fold's terrains for the test."""
    input:
        pictures="results/{run}/covers/domains/pictures/{cover_domain}",
        windows="results/{run}/covers/domains/windows/{cover_domain}",
    output:
        dataset=directory("results/{run}/covers/folds/{fold}/domains/{cover_domain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        test=COVERS.tested_in,
        seed=CONFIG.covers.scenes.seed,
    script:
        "../scripts/make_twin_dataset.py"


use rule train_detector as train_domain_detector with:
    """A detector fine-tuned on cover photos or on twins of other terrains; equal start and steps for all domains."""
    input:
        dataset="results/{run}/covers/folds/{fold}/domains/{cover_domain}",
        pictures="results/{run}/covers/domains/windows/{cover_domain}",  # read through dataset
        start=COVERS.weights_before,
    output:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/domains/{cover_domain}.pt",
        curve="results/{run}/covers/folds/{fold}/seed{seed}/domains/{cover_domain}.csv",
    params:
        options=COVERS.fine_tuning(),
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work=placed("results/{run}/covers/folds/{fold}/seed{seed}/domains_work/{cover_domain}"),


use rule predict as predict_domains with:
    """Predictions on the cover photos of a fold and on their twins."""
    input:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/domains/{cover_domain}.pt",
        datasets=expand("results/{{run}}/covers/folds/{{fold}}/domains/{domain}", domain=COVERS.evaluated),
        pictures=expand("results/{{run}}/covers/domains/pictures/{domain}", domain=COVERS.evaluated),  # read through datasets
        cameras=PATHS.sand("cameras/located", COVERS.terrains),
        meshes=PATHS.sand("meshes", COVERS.terrains),
    output:
        predictions=expand(
            "results/{{run}}/covers/folds/{{fold}}/seed{{seed}}/domains/predictions/{{cover_domain}}_on_{domain}.parquet",
            domain=COVERS.evaluated,
        ),


rule compare_domains:
    """mAP, IOU_mean, IPD and paired differences of the detectors of a seed over the photos of all folds."""
    input:
        predictions=expand(
            "results/{{run}}/covers/folds/{fold}/seed{{seed}}/domains/predictions/{trained}_on_{evaluated}.parquet",
            fold=COVERS.folds,
            trained=COVERS.trained,
            evaluated=COVERS.evaluated,
        ),
        labels=expand("results/{{run}}/covers/domains/labels/{domain}.parquet", domain=COVERS.evaluated),
        datasets=expand(
            "results/{{run}}/covers/folds/{fold}/domains/{domain}", fold=COVERS.folds, domain=COVERS.domains[:1]
        ),
    output:
        **{table: f"results/{{run}}/covers/domains/seed{{seed}}/{table}.parquet" for table in COMPARED},
        photos="results/{run}/covers/domains/seed{seed}/photos.parquet",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=15,
    params:
        domains=COVERS.evaluated,
        photo_domain=CONFIG.photo_domain,
        options=options("detect.comparison"),
        training=COVERS.fine_tuning(),
        start=COVERS.start,
        imgsz=CONFIG.detect.pictures.imgsz,
    script:
        "../scripts/compare_domains.py"


use rule gather_tables as gather_domains with:
    """Tables of all seeds."""
    input:
        **{
            table: of_run(f"results/{{run}}/covers/domains/seed{{seed}}/{table}.parquet", seed=SEEDS)
            for table in [*COMPARED, "photos"]
        },
    output:
        **{table: f"results/{{run}}/covers/domains/{table}.parquet" for table in [*COMPARED, "photos"]},
    params:
        splits=["terrain"] * len(SEEDS),
        seeds=SEEDS,


rule report_real_tables:
    """Tables of detection and IPD in the layout of the paper, paired differences, the IPD of each photo; figures."""
    input:
        detection="results/{run}/covers/domains/detection.parquet",
        ipd="results/{run}/covers/domains/ipd.parquet",
        differences="results/{run}/covers/domains/differences.parquet",
        photos="results/{run}/covers/domains/photos.parquet",
        pictures=expand("results/{{run}}/covers/domains/pictures/{domain}", domain=COVERS.evaluated),
        drawn="results/{run}/covers/drawn",
        labels=expand("results/{{run}}/covers/domains/labels/{domain}.parquet", domain=COVERS.evaluated),
        twins=of_run(  # read through params.twins
            "results/{run}/renders/{model}/Terrain{terrain}", model=MODELS, terrain=TERRAINS
        ),
        control=of_run("results/{run}/covers/control/pictures/Terrain{terrain}", terrain=TERRAINS),  # read through params.twins
    output:
        # written through real_detection
        **table_files(
            real_detection="detection on real photos and twins",
            real_ipd="IPD of real photos and twins",
            real_differences="paired differences on real photos and twins",
            real_photos="IPD of each real photo",
        ),
        ipd_figure=shown("results/{run}/figures/real_ipd.png", "Detection", picture="IPD of real photos and twins"),
        pairs_figure=shown("results/{run}/figures/real_pairs.png", "Detection", picture="real photos and twins"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    params:
        domains=COVERS.evaluated,
        twins=COVERS.folders_of_twins,
        origin=ORIGIN,
    script:
        "../scripts/report_real_tables.py"


rule draw_real_gap:
    """Difference of detection between photos and twins over the appearance of the twins."""
    input:
        photos="results/{run}/tables/real_photos.parquet",
    output:
        figure=shown("results/{run}/figures/real_gap.png", "Detection", picture="IPD and appearance"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    script:
        "../scripts/draw_real_gap.py"
