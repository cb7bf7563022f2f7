"""The landmark map: its model, its database and the texts it is exchanged in."""
