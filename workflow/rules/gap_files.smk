"""Files of the ablation: what each component is rendered from, what the ablation is computed from."""

COMPONENTS = CONFIG.gap.components
PICTURED = [name for name, found in COMPONENTS.items() if found.is_rendered]
ABLATION_DOMAINS = [CONFIG.photo_domain, CONFIG.gap.model, *COMPONENTS]
ABLATION_PAIRS = [(trained, domain) for trained in CONFIG.ablation_detectors for domain in ABLATION_DOMAINS]


wildcard_constraints:
    component=one_of(PICTURED),


def cameras_of_component(wildcards):
    """The folder with the poses and lenses that a component's twins have."""
    return {
        "run": "results/{run}/cameras/Terrain{terrain}",
        "located": "results/{run}/cameras/located/Terrain{terrain}",
        "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
    }[COMPONENTS[wildcards.component].cameras]


def lamps_of_component(wildcards):
    """The folder with the positions of their lamps; that of located poses names none, so the survey's hold."""
    return {
        "run": "results/{run}/cameras/Terrain{terrain}",
        "survey": "results/{run}/cameras/located/Terrain{terrain}",
        "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
    }[COMPONENTS[wildcards.component].lamps]


def meshes_of_component(wildcards):
    """The folder with their meshes."""
    return {
        "run": "results/{run}/meshes/Terrain{terrain}",
        "thinned": "results/{run}/gap/thinned/Terrain{terrain}",
        "truth": "results/{run}/gap/truth/meshes/Terrain{terrain}",
    }[COMPONENTS[wildcards.component].meshes]


def materials_of_component(wildcards):
    """The folder with their materials, where they are fitted."""
    chosen = COMPONENTS[wildcards.component].materials
    return {"run": MATERIALS_OF_TERRAIN, "fitted": FITTED_MATERIALS}.get(chosen, [])


def options_of_component(wildcards):
    """Options of their rendering."""
    return CONFIG.render_options_of(wildcards.component).model_dump(mode="json")


def twin_behind(domain):
    """A component without pictures of its own is looked at in the twin's."""
    return CONFIG.gap.model if domain in COMPONENTS else domain


def ablation_predictions():
    """What detectors see in photos, in the twin, and in the twin of every component."""
    return [
        (
            f"results/{{run}}/gap/{{split}}/seed{{seed}}/predictions/{trained}_on_{domain}.parquet"
            if domain in PICTURED
            else f"results/{{run}}/detect/{{split}}/seed{{seed}}/predictions/{trained}_on_{twin_behind(domain)}.parquet"
        )
        for trained, domain in ABLATION_PAIRS
    ]


def ablation_datasets():
    """Data sets of the same domains."""
    return [
        (
            f"results/{{run}}/gap/{{split}}/datasets/{domain}"
            if domain in PICTURED
            else f"results/{{run}}/detect/{{split}}/datasets/{twin_behind(domain)}"
        )
        for domain in ABLATION_DOMAINS
    ]


def ablation_labels():
    """Labels of the same domains."""
    paths = []
    for domain in ABLATION_DOMAINS:
        propagated = domain in COMPONENTS and COMPONENTS[domain].labels == "propagated"
        if domain in PICTURED and not propagated:
            paths += [f"results/{{run}}/gap/twins/{domain}/labels.parquet"]
        else:
            paths += labels_of(CONFIG.photo_domain if propagated else twin_behind(domain))
    return paths
