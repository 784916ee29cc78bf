"""The experiments of Hofer, Yamagishi and Shimodaira 2008, on any corpus."""
