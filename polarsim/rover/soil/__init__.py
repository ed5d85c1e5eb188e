"""Ground that gives way: soils (`law`), grid (`nodes`), wheels (`shapes`), `contact`, displaced soil (`bulldozing`)."""
