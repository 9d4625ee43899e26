"""Looking at a render: each stage of its loop, the vertices of one path, and why a pixel is bright."""
