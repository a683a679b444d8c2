"""What commands beside ``run`` answer, each as a ``Sheet``: facts and tables described once, rendered in every form."""
