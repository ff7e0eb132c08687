// Stand-in: a plugin is made by a function of C.
#pragma once

#define PLUGINLIB_EXPORT_CLASS(Derived, Base) \
  extern "C" Base *make_plugin();             \
  extern "C" Base *make_plugin() { return new Derived; }
