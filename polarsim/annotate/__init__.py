"""Tools for annotators: labels drawn into pictures, and labels and pictures for editors."""
