"""The gap ledger: twins with one ingredient replaced, seen by the detectors of the run. Scoring, so truth may be read.

Nothing made here is input of a stage. Without `gap.ingredients` there is nothing to make.
"""


rule gap:
    """Which ingredient of the twin causes the gap."""
    input:
        of_run("results/{run}/tables/gap.csv") if INGREDIENTS else [],
        of_run("results/{run}/figures/gap.png") if INGREDIENTS else [],


rule lay_truth:
    """The analog's true cameras, lamps and meshes in the run's frame."""
    input:
        raw=raw_data,
        inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
        rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
        meshes="results/{run}/meshes/Terrain{terrain}",
        located="results/{run}/cameras/located/Terrain{terrain}",
    output:
        cameras=directory("results/{run}/gap/truth/cameras/Terrain{terrain}"),
        meshes=directory("results/{run}/gap/truth/meshes/Terrain{terrain}"),
    log:
        "results/{run}/logs/gap/lay_truth_{terrain}.log",
    benchmark:
        "results/{run}/benchmarks/gap/lay_truth_{terrain}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        truth=truth_of,
        code=code_of("lay_truth"),
    script:
        "../scripts/lay_truth.py"


rule thin_meshes:
    """The run's meshes, rocks with few vertices."""
    input:
        meshes="results/{run}/meshes/Terrain{terrain}",
    output:
        thinned=directory("results/{run}/gap/thinned/Terrain{terrain}"),
    log:
        "results/{run}/logs/gap/thin_meshes_{terrain}.log",
    benchmark:
        "results/{run}/benchmarks/gap/thin_meshes_{terrain}.tsv"
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        code=code_of("thin_meshes"),
    script:
        "../scripts/thin_meshes.py"


rule render_ingredient:
    """Twins of a terrain's test photos with one ingredient replaced, and their labels."""
    input:
        cameras=cameras_of_ingredient,
        lamps=lamps_of_ingredient,
        meshes=meshes_of_ingredient,
        materials=materials_of_ingredient,
        photos=photos_of_terrain,
        splits=expand("results/{{run}}/detect/{split}/split.csv", split=SPLITS),
    output:
        twins=directory(
            "results/{run}/gap/twins/{ingredient}/pictures/Terrain{terrain}"
        ),
        boxes=directory("results/{run}/gap/twins/{ingredient}/boxes/Terrain{terrain}"),
        instances=directory(
            "results/{run}/gap/twins/{ingredient}/instances/Terrain{terrain}"
        ),
        annotations="results/{run}/gap/twins/{ingredient}/coco/Terrain{terrain}.json",
        table="results/{run}/gap/twins/{ingredient}/tables/Terrain{terrain}.parquet",
    log:
        "results/{run}/logs/gap/render_ingredient_{ingredient}_{terrain}.log",
    benchmark:
        "results/{run}/benchmarks/gap/render_ingredient_{ingredient}_{terrain}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        positions=positions_here,
        grid=options("grid"),
        model=CONFIG.gap.model,
        options=options_of_ingredient,
        code=code_of("render_ingredient"),
    script:
        "../scripts/render_ingredient.py"


rule merge_ingredient_labels:
    """One table of the labels of an ingredient's twins."""
    input:
        tables=expand(
            "results/{{run}}/gap/twins/{{ingredient}}/tables/Terrain{terrain}.parquet",
            terrain=TERRAINS,
        ),
    output:
        merged="results/{run}/gap/twins/{ingredient}/labels.parquet",
    log:
        "results/{run}/logs/gap/merge_ingredient_labels_{ingredient}.log",
    benchmark:
        "results/{run}/benchmarks/gap/merge_ingredient_labels_{ingredient}.tsv"
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        code=code_of("merge_labels"),
    script:
        "../scripts/merge_labels.py"


rule convert_ingredient:
    """The test pictures of an ingredient's twins as detectors take them."""
    input:
        pictures=expand(
            "results/{{run}}/gap/twins/{{ingredient}}/pictures/Terrain{terrain}",
            terrain=TERRAINS,
        ),
        labels="results/{run}/gap/twins/{ingredient}/labels.parquet",
        split="results/{run}/detect/{split}/split.csv",
    output:
        dataset=directory("results/{run}/gap/{split}/datasets/{ingredient}"),
    log:
        "results/{run}/logs/gap/convert_ingredient_{split}_{ingredient}.log",
    benchmark:
        "results/{run}/benchmarks/gap/convert_ingredient_{split}_{ingredient}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        options=options("detect.pictures"),
        code=code_of("convert_ingredient"),
    script:
        "../scripts/convert_ingredient.py"


rule predict_ingredient:
    """What a detector sees in an ingredient's twins."""
    input:
        weights="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.pt",
        datasets=["results/{run}/gap/{split}/datasets/{ingredient}"],
    output:
        predictions=[
            "results/{run}/gap/{split}/seed{seed}/predictions/{trained}_on_{ingredient}.parquet"
        ],
    log:
        "results/{run}/logs/gap/predict_ingredient_{split}_seed{seed}_{trained}_{ingredient}.log",
    benchmark:
        "results/{run}/benchmarks/gap/predict_ingredient_{split}_seed{seed}_{trained}_{ingredient}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=240,
    params:
        options=options("detect.prediction"),
        code=code_of("predict"),
    script:
        "../scripts/predict.py"


rule weigh_ingredients:
    """Change of IPD, mAP and false alarms by every ingredient, with intervals, for a split and seed."""
    input:
        predictions=ledger_predictions(),
        labels=ledger_labels(),
        datasets=ledger_datasets(),
    output:
        ledger="results/{run}/gap/{split}/seed{seed}/ledger.parquet",
    log:
        "results/{run}/logs/gap/weigh_ingredients_{split}_seed{seed}.log",
    benchmark:
        "results/{run}/benchmarks/gap/weigh_ingredients_{split}_seed{seed}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        sights=LEDGER_SIGHTS,
        domains=LEDGER_DOMAINS,
        photo=CONFIG.photo_domain,
        twin=CONFIG.gap.model,
        replaced={name: found.told() for name, found in INGREDIENTS.items()},
        options=options("detect.comparison"),
        training=options("detect.training"),
        imgsz=CONFIG.detect.pictures.imgsz,
        code=code_of("weigh_ingredients"),
    script:
        "../scripts/weigh_ingredients.py"


rule gather_ledger:
    """One ledger of all splits and seeds."""
    input:
        parts=of_run(
            "results/{run}/gap/{split}/seed{seed}/ledger.parquet",
            split=SPLITS,
            seed=SEEDS,
        ),
    output:
        table="results/{run}/gap/ledger.parquet",
    log:
        "results/{run}/logs/gap/gather_ledger.log",
    benchmark:
        "results/{run}/benchmarks/gap/gather_ledger.tsv"
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        splits=[split for split in SPLITS for seed in SEEDS],
        seeds=[seed for split in SPLITS for seed in SEEDS],
        code=code_of("gather_tables"),
    script:
        "../scripts/gather_tables.py"


rule tabulate_gap:
    """The ledger, the ingredient that closes most of the gap first."""
    input:
        ledger="results/{run}/gap/ledger.parquet",
    output:
        table=report(
            "results/{run}/tables/gap.csv",
            caption="../report/gap_table.rst",
            category="Tables",
            labels={"table": "gap ledger"},
        ),
        others=multiext("results/{run}/tables/gap", ".md", ".tex", ".parquet"),
    log:
        "results/{run}/logs/gap/tabulate_gap.log",
    benchmark:
        "results/{run}/benchmarks/gap/tabulate_gap.tsv"
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        origin=ORIGIN,
        code=code_of("tabulate_gap"),
    script:
        "../scripts/tabulate_gap.py"


rule draw_gap:
    """Bars of the change of IPD and of false alarms by every ingredient."""
    input:
        ledger="results/{run}/gap/ledger.parquet",
    output:
        figure=report(
            "results/{run}/figures/gap.png",
            caption="../report/gap.rst",
            category="Detection",
            labels={"picture": "gap ledger"},
        ),
    log:
        "results/{run}/logs/gap/draw_gap.log",
    benchmark:
        "results/{run}/benchmarks/gap/draw_gap.tsv"
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        origin=ORIGIN,
        code=code_of("draw_gap"),
    script:
        "../scripts/draw_gap.py"
