"""A page in the browser that shows a running ``terrain_collider``, by its topics and services only; docs/view.md."""
