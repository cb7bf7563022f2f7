"""The detector's training: the set of pictures, the network, its loss, the training itself, evaluation and export."""
