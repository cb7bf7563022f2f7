"""Files elsewhere, by their URLs: object stores and web servers, through fsspec. Nothing here is loaded for paths."""
