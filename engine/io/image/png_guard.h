// Internal to the reader and the writer of PNG: calls of libpng.
//
// libpng reports errors by longjmp(), which must pass no destructor. So each call of the library
// stands in guarded(), and what it calls back keeps an exception and leaves it to fail().
#pragma once

#include <csetjmp>
#include <exception>
#include <new>
#include <string>

#include <png.h>

namespace ptc {

/// A state of libpng whose errors become exceptions.
class PngGuard {
 protected:
  PngGuard() = default;
  virtual ~PngGuard() = default;

  /// Lets the library do something. @param step  makes no object with a destructor
  /// @throws what fail() throws
  template <typename Step>
  void guarded(const Step& step) {
    if (setjmp(png_jmpbuf(png_)) != 0) fail();
    step();
  }
  /// Throws the exception of the file, or one with the message of the library.
  [[noreturn]] virtual void fail() const = 0;

  // The functions that the library calls for errors and warnings; its pointer is a PngGuard.

  static void note(png_structp png, png_const_charp text) {
    try {
      static_cast<PngGuard*>(png_get_error_ptr(png))->message_ = text;
    } catch (const std::bad_alloc&) {  // the message stays empty
    }
    png_longjmp(png, 1);
  }
  static void ignore(png_structp /*png*/, png_const_charp /*text*/) {}

  png_structp png_ = nullptr;
  std::exception_ptr failure_;  ///< of the file
  std::string message_;         ///< of the library
};

}  // namespace ptc
