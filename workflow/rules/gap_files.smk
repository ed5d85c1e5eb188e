"""Files of the gap ledger: what each ingredient is rendered from, what the ledger is weighed of."""

INGREDIENTS = CONFIG.gap.ingredients
PICTURED = [name for name, found in INGREDIENTS.items() if found.is_rendered]
LEDGER_DOMAINS = [CONFIG.photo_domain, CONFIG.gap.model, *INGREDIENTS]
LEDGER_SIGHTS = [
    (trained, domain) for trained in CONFIG.ledger_detectors for domain in LEDGER_DOMAINS
]


wildcard_constraints:
    ingredient=one_of(PICTURED),


def cameras_of_ingredient(wildcards):
    """The folder with the poses and lenses that an ingredient's twins have."""
    return {
        "run": "results/{run}/cameras/Terrain{terrain}",
        "located": "results/{run}/cameras/located/Terrain{terrain}",
        "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
    }[INGREDIENTS[wildcards.ingredient].cameras]


def lamps_of_ingredient(wildcards):
    """The folder with the places of their lamps; that of located poses names none, so the survey's hold."""
    return {
        "run": "results/{run}/cameras/Terrain{terrain}",
        "survey": "results/{run}/cameras/located/Terrain{terrain}",
        "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
    }[INGREDIENTS[wildcards.ingredient].lamps]


def meshes_of_ingredient(wildcards):
    """The folder with their meshes."""
    return {
        "run": "results/{run}/meshes/Terrain{terrain}",
        "thinned": "results/{run}/gap/thinned/Terrain{terrain}",
        "truth": "results/{run}/gap/truth/meshes/Terrain{terrain}",
    }[INGREDIENTS[wildcards.ingredient].meshes]


def materials_of_ingredient(wildcards):
    """The folder with their materials, where they are fitted."""
    chosen = INGREDIENTS[wildcards.ingredient].materials
    as_run = chosen == "run" and CONFIG.render.materials_from_photos
    fitted = as_run or chosen == "fitted"
    return "results/{run}/renders/materials/Terrain{terrain}" if fitted else []


def options_of_ingredient(wildcards):
    """Options of their rendering."""
    return CONFIG.render_options_of(wildcards.ingredient).model_dump(mode="json")


def twin_behind(domain):
    """An ingredient without pictures of its own is looked at in the twin's."""
    return CONFIG.gap.model if domain in INGREDIENTS else domain


def ledger_predictions():
    """What detectors see in photos, in the twin, and in the twin of every ingredient."""
    return [
        (
            f"results/{{run}}/gap/{{split}}/seed{{seed}}/predictions/{trained}_on_{domain}.parquet"
            if domain in PICTURED
            else f"results/{{run}}/detect/{{split}}/seed{{seed}}/predictions/{trained}_on_{twin_behind(domain)}.parquet"
        )
        for trained, domain in LEDGER_SIGHTS
    ]


def ledger_datasets():
    """Data sets of the same domains."""
    return [
        (
            f"results/{{run}}/gap/{{split}}/datasets/{domain}"
            if domain in PICTURED
            else f"results/{{run}}/detect/{{split}}/datasets/{twin_behind(domain)}"
        )
        for domain in LEDGER_DOMAINS
    ]


def ledger_labels():
    """Labels of the same domains."""
    paths = []
    for domain in LEDGER_DOMAINS:
        carried = domain in INGREDIENTS and INGREDIENTS[domain].labels == "carried"
        if domain in PICTURED and not carried:
            paths += [f"results/{{run}}/gap/twins/{domain}/labels.parquet"]
        else:
            paths += labels_of(CONFIG.photo_domain if carried else twin_behind(domain))
    return paths
