"""A page in the browser that shows a running ``terrain_collider``, over its topics and services alone; docs/view.md."""
