"""Materials fitted to photos: albedo of every vertex, parameters of the models, brightness of the lamps."""
