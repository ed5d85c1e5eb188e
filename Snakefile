"""Entry point of Snakemake in the checkout; the workflow is workflow/Snakefile."""


include: "workflow/Snakefile"


workflow.default_target = "all"  # Snakemake ignores the `default_target` of an included file
