from imported_models import imported, wan_source

__all__ = ["imported", "wan_source"]
