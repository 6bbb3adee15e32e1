"""A scene as one HTML page that plays it in any browser, without a server or a network."""
