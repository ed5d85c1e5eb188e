"""Paths of the ablation."""

from __future__ import annotations

from polarsim.paths.run import RunPaths
from polarsim.paths.wildcards import Options, Wildcards


class GapPaths:
    """Paths of the ablation: the inputs of each component's twins, and the inputs of the evaluation."""

    def __init__(self, run: RunPaths) -> None:
        config = run.config
        self.run, self.config = run, config
        self.components = config.gap.components
        self.rendered = [name for name, component in self.components.items() if component.is_rendered]
        self.domains = [config.photo_domain, config.ablation_model, *self.components]
        self.pairs = [(trained, domain) for trained in config.ablation_detectors for domain in self.domains]

    def cameras(self, wildcards: Wildcards) -> str:
        """Return the folder of a component's poses and lenses."""
        return {
            "run": "results/{run}/cameras/Terrain{terrain}",
            "located": "results/{run}/cameras/located/Terrain{terrain}",
            "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
        }[self.components[wildcards.component].cameras]

    def lamps(self, wildcards: Wildcards) -> str:
        """Return the folder of a component's lamps; that of located poses has none, so the survey's are used."""
        return {
            "run": "results/{run}/cameras/Terrain{terrain}",
            "survey": "results/{run}/cameras/located/Terrain{terrain}",
            "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
        }[self.components[wildcards.component].lamps]

    def meshes(self, wildcards: Wildcards) -> str:
        """Return the folder of a component's meshes."""
        return {
            "run": "results/{run}/meshes/Terrain{terrain}",
            "thinned": "results/{run}/gap/thinned/Terrain{terrain}",
            "truth": "results/{run}/gap/truth/meshes/Terrain{terrain}",
        }[self.components[wildcards.component].meshes]

    def materials(self, wildcards: Wildcards) -> str | list[str]:
        """Return the folder of a component's materials, if they are fitted."""
        chosen = self.components[wildcards.component].materials
        as_run = self.run.materials_of_terrain if self.config.render.materials_from_photos else []
        return {"run": as_run, "fitted": self.run.fitted_materials}.get(chosen, [])

    def light(self, wildcards: Wildcards) -> str | list[str]:
        """Return the light fields of a terrain, if the twins of a component are fitted."""
        fitted = self.config.render_options_of(wildcards.component).materials_from_photos
        return self.run.fitted_light if fitted else []

    def options(self, wildcards: Wildcards) -> Options:
        """Return the options of the renderer for a component."""
        return self.config.render_options_of(wildcards.component).model_dump(mode="json", exclude_unset=True)

    def predictions(self) -> list[str]:
        """Return the predictions on photos, on the twin, and on the twin of every component."""
        return [
            f"results/{{run}}/{self._stage(domain)}/{{split}}/seed{{seed}}/predictions/{trained}_on_{self._twin(domain)}.parquet"
            for trained, domain in self.pairs
        ]

    def datasets(self) -> list[str]:
        """Return the data sets of these domains."""
        return [
            f"results/{{run}}/{self._stage(domain)}/{{split}}/datasets/{self._twin(domain)}" for domain in self.domains
        ]

    def labels(self) -> list[str]:
        """Return the labels of these domains."""
        paths = []
        for domain in self.domains:
            propagated = domain in self.components and self.components[domain].labels == "propagated"
            if domain in self.rendered and not propagated:
                paths += [f"results/{{run}}/gap/twins/{domain}/labels.parquet"]
            else:
                paths += self.run.labels(self.config.photo_domain if propagated else self._twin(domain))
        return paths

    def _twin(self, domain: str) -> str:
        """Return the domain of the pictures; a component that is not rendered uses the twin's."""
        return self.config.ablation_model if domain in self.components and domain not in self.rendered else domain

    def _stage(self, domain: str) -> str:
        return "gap" if domain in self.rendered else "detect"
