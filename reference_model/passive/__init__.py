"""The motion of passive coordinates: free base, modal coordinates, spherical joints."""
