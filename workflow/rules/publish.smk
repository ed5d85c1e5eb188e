"""Forms in which the run leaves, each with its data card; not part of `all`, for pictures are copied."""


rule publish:
    """Every form that the configuration names."""
    input:
        of_run("results/{run}/publish/{form}.json", form=CONFIG.publish.forms),


rule publish_run:
    """One form of the run."""
    input:
        labels=rules.labels.input,  # read through receipt
        twins=rules.render.input,  # read through receipt
        tables=rules.tables.input,  # read through receipt
        drives=rules.rover.input,  # read through receipt
    output:
        receipt="results/{run}/publish/{form}.json",
    log:
        "results/{run}/logs/publish/publish_run_{form}.log",
    benchmark:
        "results/{run}/benchmarks/publish/publish_run_{form}.tsv"
    resources:
        mem_mb=growing(4000),
        runtime=120,
    params:
        options=options("publish"),
        split=SPLITS[0] if DOMAINS else "",
        code=code_of("publish_run"),
    script:
        "../scripts/publish_run.py"
