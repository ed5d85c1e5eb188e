"""Ablation: detectors of the run on twins with one component replaced. Scoring, so ground truth may be read.

No stage reads these outputs. Without `gap.components` there are no outputs.
"""


rule gap:
    """Contribution of the components of the twin to the gap."""
    input:
        of_run("results/{run}/tables/gap.csv") if GAP.components else [],
        of_run("results/{run}/figures/gap.png") if GAP.components else [],


rule write_truth:
    """True cameras, lamps and meshes of the analog in the frame of the run."""
    input:
        raw=PATHS.raw_data,  # read through params.truth
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
        meshes="results/{run}/meshes/Terrain{terrain}",
        located="results/{run}/cameras/located/Terrain{terrain}",
    output:
        true_cameras=directory("results/{run}/gap/truth/cameras/Terrain{terrain}"),
        true_meshes=directory("results/{run}/gap/truth/meshes/Terrain{terrain}"),
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=10,
    params:
        truth=PATHS.truth,
    script:
        "../scripts/write_truth.py"


rule thin_meshes:
    """Meshes of the run with thinned rocks."""
    input:
        meshes="results/{run}/meshes/Terrain{terrain}",
    output:
        thinned=directory("results/{run}/gap/thinned/Terrain{terrain}"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    script:
        "../scripts/thin_meshes.py"


rule render_component:
    """Test twins of a terrain with one component replaced, and labels."""
    input:
        cameras=GAP.cameras,
        lamps=GAP.lamps,
        meshes=GAP.meshes,
        materials=GAP.materials,
        light=GAP.light,
        photos=PATHS.photos_of_terrain,
        splits=expand("results/{{run}}/detect/{split}/split.csv", split=SPLITS),
    output:
        twins=directory("results/{run}/gap/twins/{component}/pictures/Terrain{terrain}"),
        boxes=directory("results/{run}/gap/twins/{component}/boxes/Terrain{terrain}"),
        instances=directory("results/{run}/gap/twins/{component}/instances/Terrain{terrain}"),
        annotations="results/{run}/gap/twins/{component}/coco/Terrain{terrain}.json",
        table="results/{run}/gap/twins/{component}/tables/Terrain{terrain}.parquet",
    resources:
        mem_mb=memory_per_attempt(4000),
        runtime=30,
        gpu=PATHS.gpus("render"),
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        model=CONFIG.ablation_model,
        options=GAP.options,
    script:
        "../scripts/render_component.py"


use rule merge_labels as merge_component_labels with:
    """Table of the labels of the twins of a component."""
    input:
        tables=expand("results/{{run}}/gap/twins/{{component}}/tables/Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        merged="results/{run}/gap/twins/{component}/labels.parquet",
    priority: 0


rule convert_component:
    """Data set of the test twins of a component."""
    input:
        pictures=expand("results/{{run}}/gap/twins/{{component}}/pictures/Terrain{terrain}", terrain=TERRAINS),
        labels="results/{run}/gap/twins/{component}/labels.parquet",
        split="results/{run}/detect/{split}/split.csv",
    output:
        dataset=directory("results/{run}/gap/{split}/datasets/{component}"),
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=60,
    params:
        options=options("detect.pictures"),
    script:
        "../scripts/convert_component.py"


use rule predict as predict_component with:
    """Predictions of a detector on the twins of a component."""
    input:
        weights="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.pt",
        datasets=["results/{run}/gap/{split}/datasets/{component}"],
        cameras=PATHS.sand("cameras"),
        meshes=PATHS.sand("meshes"),
    output:
        predictions=["results/{run}/gap/{split}/seed{seed}/predictions/{trained}_on_{component}.parquet"],


rule run_ablation:
    """Change of IPD, mAP and false positives by each component, with intervals, for a split and seed."""
    input:
        predictions=GAP.predictions(),
        labels=GAP.labels(),
        datasets=GAP.datasets(),
    output:
        ablation="results/{run}/gap/{split}/seed{seed}/ablation.parquet",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=60,
    params:
        evaluated=GAP.pairs,
        domains=GAP.domains,
        photo=CONFIG.photo_domain,
        twin=CONFIG.ablation_model,
        replaced={name: found.describe() for name, found in GAP.components.items()},
        options=options("detect.comparison"),
        training=options("detect.training"),
        imgsz=CONFIG.detect.pictures.imgsz,
    script:
        "../scripts/run_ablation.py"


use rule gather_tables as gather_ablation with:
    """Table of all splits and seeds."""
    input:
        ablation=of_run("results/{run}/gap/{split}/seed{seed}/ablation.parquet", split=SPLITS, seed=SEEDS),
    output:
        ablation="results/{run}/gap/ablation.parquet",
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,


rule report_gap:
    """Ablation table, sorted by the reduction of the gap, and bar chart of the change by each component."""
    input:
        ablation="results/{run}/gap/ablation.parquet",
    output:
        **table_files(gap="ablation"),
        figure=shown("results/{run}/figures/gap.png", "Detection", picture="ablation"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/report_gap.py"
