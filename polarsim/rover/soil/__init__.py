"""Deformable soil: soils (`law`), grid (`nodes`), wheels (`shapes`), `contact`, displaced soil (`bulldozing`)."""
