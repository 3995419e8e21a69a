// What every user of Embree needs: owned handles, and its pending error as an exception. Private to
// the layers that link Embree.
#pragma once

#include <new>
#include <stdexcept>
#include <string>

#include <embree3/rtcore.h>

namespace ptc {

/// Throws the error that a device has pending, if any.
/// @throws std::bad_alloc when Embree is out of memory; std::runtime_error for any other error
inline void check_device(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_OUT_OF_MEMORY) {
    // Call the program's handler first, as operator new does: Embree may call std::terminate when
    // it has to release a scene without memory.
    if (const std::new_handler handler = std::get_new_handler()) handler();
    throw std::bad_alloc();
  }
  if (error != RTC_ERROR_NONE) {
    throw std::runtime_error("Embree: error " + std::to_string(static_cast<int>(error)));
  }
}

/// Owns a handle that one of Embree's rtcNew... functions returned; null is allowed.
template <typename Handle, void (*release)(Handle)>
class Owned {
 public:
  explicit Owned(Handle handle) : handle_(handle) {}
  ~Owned() {
    if (handle_ != nullptr) release(handle_);
  }
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  operator Handle() const noexcept { return handle_; }

 private:
  Handle handle_;
};

}  // namespace ptc
