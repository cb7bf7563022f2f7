"""The bundled recordings."""
