"""The motion of what no actuator drives: free base, modal coordinates, spherical joints."""
